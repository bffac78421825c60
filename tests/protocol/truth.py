"""Says what it is told of the truth."""

from wire import serve


def perform(link, begin):
    observations = [begin["observation"], link.ask({"type": "command"})]
    told = [observation.get("truth", {"objects": []})["objects"] for observation in observations]
    names = sorted(thing["id"] for thing in told[0])
    assert names == sorted(thing["id"] for thing in told[1])
    message = f"told of {', '.join(names)}" if names else "told nothing"
    return {"type": "end", "succeeded": True, "message": message}


serve(perform)
