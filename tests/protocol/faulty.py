"""Shows the fault that FAULT names while the file FAULT_ONCE exists; without that variable, depending on the seed.

A first argument replaces the variables and names the fault of every run."""

import os
import subprocess
import sys
import time

import wire

FOREVER = 600
KINDS = (
    "exit silent raise killed shut garbage short_garbage not_json not_object unknown_type unknown_key wrong_kind long_frame two "
    "drip unknown_joint finger joint_twice joint_in_two_lists no_ticks not_a_number infinite children runaway "
    "zero_quaternion degrees millimetres"
).split()


def leave_children():
    """Starts one child in the same process group and one in its own session: both would run for minutes."""
    for own in (False, True):
        subprocess.Popen([sys.executable, "-c", f"import time; time.sleep({FOREVER})"], start_new_session=own)


def wrong(link, kind):
    joint = link.hello["robot"]["arm_joints"][0]
    if kind in ("exit", "children", "runaway"):
        if kind != "exit":
            leave_children()
        print("the last words")
        sys.stdout.flush()
        os._exit(0 if kind == "children" else 3)
    if kind == "silent":
        time.sleep(FOREVER)
    elif kind == "raise":
        raise ValueError("no idea what to do")
    elif kind == "killed":
        os.kill(os.getpid(), 11)
    elif kind == "shut":
        link.socket.close()
        time.sleep(FOREVER)
    elif kind == "garbage":
        link.raw(os.urandom(4) + b"\xff" + os.urandom(1000))
    elif kind == "short_garbage":
        link.raw(b"{}\n")
    elif kind == "not_json":
        link.raw(b"\x04\x00\x00\x00Jnope")
    elif kind == "not_object":
        link.send([1, 2, 3])
    elif kind == "unknown_type":
        link.send({"type": "dance"})
    elif kind == "unknown_key":
        link.send({"type": "command", "postions": {}})
    elif kind == "wrong_kind":
        link.raw(b"\x02\x00\x00\x00B{}")
    elif kind == "long_frame":
        link.raw(b"\xff\xff\xff\x7fJ")
    elif kind == "two":
        text = b'{"type": "command", "ticks": 1}'
        frame = len(text).to_bytes(4, "little") + b"J" + text
        link.raw(frame + frame)
    elif kind == "drip":
        link.raw(b"\x00\x01\x00\x00J")
        for _ in range(200):
            time.sleep(0.05)
            link.raw(b" ")
    elif kind == "unknown_joint":
        link.send({"type": "command", "positions": {joint + "t": 0.0}})
    elif kind == "finger":
        link.send({"type": "command", "positions": {link.hello["robot"]["gripper_joints"][0]: 0.0}})
    elif kind == "joint_twice":
        text = f'{{"type": "command", "positions": {{"{joint}": 0.0, "{joint}": 1.0}}}}'.encode()
        link.raw(len(text).to_bytes(4, "little") + b"J" + text)
    elif kind == "joint_in_two_lists":
        link.send({"type": "command", "positions": {joint: 0.0}, "velocities": {joint: 0.0}})
    elif kind == "no_ticks":
        link.send({"type": "command", "ticks": 0})
    elif kind == "not_a_number":
        link.send({"type": "command", "positions": {joint: float("nan")}})
    elif kind == "infinite":
        text = f'{{"type": "command", "positions": {{"{joint}": 1e999}}}}'.encode()
        link.raw(len(text).to_bytes(4, "little") + b"J" + text)
    elif kind == "degrees":
        link.send({"type": "command", "positions": {link.hello["robot"]["arm_joints"][1]: -45}})
    elif kind == "millimetres":
        link.send({"type": "command", "gripper": {"opening_m": 80}})
    elif kind == "zero_quaternion":
        pose = {"position_m": [0, 0, 0], "quaternion_xyzw": [0, 0, 0, 0]}
        link.send({"type": "end", "succeeded": True, "held": {"pose": pose, "size_m": [0.1, 0.1, 0.1]}})
    elif kind == "chatter":
        for _ in range(40):
            os.write(1, b"x" * (1 << 20))
    elif kind == "memory":
        print(len(bytearray(1 << 32)))
    elif kind == "busy":
        while True:
            pass
    time.sleep(FOREVER)


def at_start(kind):
    if kind == "exit_at_start":
        sys.exit("can't find my weights")
    if kind == "never_connects":
        time.sleep(FOREVER)
    link = wire.Link()
    link.receive()
    if kind == "silent_at_start":
        time.sleep(FOREVER)
    hello = {"type": "hello", "protocol": 1, "name": "faulty", "actions": ["Pick"]}
    if kind == "other_version":
        hello["protocol"] = 2
    elif kind == "no_action":
        hello["actions"] = ["Pikc"]
    elif kind == "odd_hello":
        hello["colour"] = "red"
    elif kind == "bye_at_start":
        hello = {"type": "bye"}
    link.send(hello)
    time.sleep(FOREVER)


def now(once):
    if once is None:
        return True
    if os.path.exists(once):
        os.remove(once)
        return True
    return False


def main():
    kind, once = os.environ.get("FAULT"), os.environ.get("FAULT_ONCE")
    starts = "exit_at_start never_connects silent_at_start other_version no_action odd_hello bye_at_start".split()
    if kind in starts and now(once):
        at_start(kind)

    def perform(link, begin):
        if kind is None:
            choice = link.run["seed"] % (2 * len(KINDS))
            if choice < len(KINDS):
                wrong(link, KINDS[choice])
        elif kind not in starts and kind != "stays" and now(once):
            wrong(link, kind)
        return {"type": "end", "succeeded": True, "message": "did nothing"}

    wire.serve(perform)
    if kind == "stays":
        time.sleep(FOREVER)


main()
