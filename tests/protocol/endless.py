"""Performs its action until it is aborted; records each of its starts."""

from wire import serve


def perform(link, begin):
    while link.ask({"type": "command", "ticks": 20})["type"] == "observation":
        pass


with open("starts", "a") as starts:
    starts.write("started\n")
serve(perform)
