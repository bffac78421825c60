"""Takes colour images before and after a motion, and reports their digests and brightness."""

import hashlib

from wire import serve


def perform(link, begin):
    words = []
    for tilt in (-0.6, -0.4):
        link.ask({"type": "command", "ticks": 60, "head": {"tilt_rad": tilt}})
        image = link.ask({"type": "ask", "what": "rgb"})
        assert image["binary"] == [{"name": "rgb", "dtype": "u8", "shape": [image["height"], image["width"], 3]}]
        (data,) = image["frames"]
        words.append(f"{hashlib.sha256(data).hexdigest()[:16]} {sum(data) / len(data):.1f}")
    return {"type": "end", "succeeded": False, "message": ", ".join(words)}


serve(perform)
