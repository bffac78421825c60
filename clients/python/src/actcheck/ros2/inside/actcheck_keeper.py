"""Keeps a node in step with the simulation, from inside its process and without a change to its source.

No simulated time passes while nodes compute. The simulation gives the processes turns, one at a time. In its turn, a
process does everything that is ready and then says that it is idle; between turns it does nothing. Within a process one
thread runs at a time: it has the *baton*. A thread that waits (in an executor, for a lock, a condition or a time) gives the
baton away, and enters a queue when it is woken. So the order of all callbacks is the same every time, also with a
multi-threaded executor.

Waiting times are simulated ones: `time.sleep(0.1)` in a callback and `spin_once(timeout_sec=0.1)` end when the simulated
time is 0.1 s later, as on a robot whose clocks agree. Messages are reliable, whatever a node asks for.

Before the first turn the process is free: it starts as it would without the simulation.

Only the standard library and rclpy are used: this runs in the nodes' Python, which need not have actcheck.
"""

import _thread
import json
import os
import socket
import struct
import sys
import threading
import time
import weakref
from collections import deque

_LENGTH = struct.Struct("<I")
#: Sleeps by the wall clock: `sitecustomize.py` has replaced `time.sleep`.
_sleep = time.sleep.native
_wall = time.monotonic
_Lock = _thread.allocate_lock
_me = _thread.get_ident
STANDARD = os.path.dirname(os.__file__)
#: Kinds of entities of a wait set.
_KINDS = ("subscription", "timer", "client", "service", "guard_condition")
#: How often a free process looks whether it is held. Unit: seconds.
_LOOK_S = 0.02
#: How long a process has to end after the simulation. Unit: seconds.
_GRACE_S = 5.0
#: Topics with which both sides know that all earlier messages have arrived: of a process, and to it.
MARK, TURN = "/actcheck/mark", "/actcheck/turn_"


class Parked:
    """A thread that waits, or the work of a pool that waits for a thread."""

    __slots__ = ("wake", "ident", "woken", "queued", "pool", "work")

    def __init__(self, pool=None, work=None):
        self.wake = _Lock()
        self.wake.acquire()
        self.ident = None if work else _me()
        self.woken = self.queued = False
        self.pool, self.work = pool, work


def _position(task):
    """The place that a coroutine has reached; `None` if the task is another function, not begun, or done."""
    coroutine = getattr(task, "_handler", None)
    if getattr(coroutine, "cr_await", None) is None:
        return None
    found = []
    while coroutine is not None:
        frame = getattr(coroutine, "cr_frame", None) or getattr(coroutine, "gi_frame", None)
        found.append((id(coroutine), frame and frame.f_lasti))
        coroutine = getattr(coroutine, "cr_await", None)
    return found


class Pool:
    """Replaces the thread pool of a multi-threaded executor: its threads take turns."""

    def __init__(self, keeper, most):
        self.keeper, self.most, self.active = keeper, most, 0
        #: Threads without work: each waits for its lock, and finds the work beside it.
        self.idle = []

    def submit(self, work):
        """Queues work; it begins when a thread of the pool is free and the baton comes round."""
        with self.keeper.lock:
            self.keeper.ready(Parked(self, work))
            self.keeper.grant()

    def start(self, parked):
        """Begins queued work. Called with the keeper's lock."""
        self.active += 1
        if self.idle:
            place = self.idle.pop()
            place[1] = parked.work
            place[0].release()
        else:
            lock = _Lock()
            lock.acquire()
            _thread.start_new_thread(self.perform, ([lock, parked.work],))

    def perform(self, place):
        """A thread of the pool."""
        keeper = self.keeper
        while True:
            if keeper.holder == -1:
                keeper.holder = _me()
            before = _position(place[1])
            try:
                place[1]()
            finally:
                with keeper.lock:
                    # Executors try tasks again that await something; a try that changes nothing does not count.
                    if before is None or _position(place[1]) != before:
                        keeper.activity += 1
                    self.active -= 1
                    place[1] = None
                    self.idle.append(place)
                    if keeper.holder == _me():
                        keeper.holder = None
                    keeper.grant()
            place[0].acquire()

    def shutdown(self, wait=True, **_):
        """Waits for the threads, for a while: they may sleep."""
        since = _wall()
        while wait and self.active and _wall() - since < 1.0:
            _sleep(0.005)


class Keeper:
    """The turns and the baton of one process."""

    def __init__(self, address):
        self.lock = _Lock()
        #: Whether the process acts only in its turns, and whether it is its turn.
        self.held = self.open = False
        #: Whether the simulation has gone: waiting is by the wall clock for good.
        self.ended = False
        #: The thread with the baton.
        self.holder = None
        self.queue = deque()
        #: Executors that wait for something to do, and the activity at which each found nothing.
        self.polls, self.polled, self.deadlines = {}, {}, {}
        self.activity = 0
        #: How often a timer of rcl's own was ready at a moment.
        self.tries = {}
        self.sleepers, self.serial = [], 0
        self.now = 0
        self.sends = self.foreign = self.marker = 0
        self.faults, self.noted = [], set()
        self.sources, self.nodes = weakref.WeakSet(), weakref.WeakSet()
        #: A hidden node of the keeper's, and its ends of the topics `MARK` and `TURN`.
        self.own, self.marks, self.turns = None, None, None
        #: rclpy's own sending and wait set, which the nodes no longer have.
        self.publish, self.wait_set = None, None
        #: Executors that have been in `wait`.
        self.executors = set()
        self.exempt = set()
        self.connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.connection.connect(address)
        self.writing = _Lock()
        number = int(os.environ.get("ACTCHECK_ROS_NUMBER", "0"))
        self.send({"hello": os.getpid(), "number": number, "command": sys.argv})
        _thread.start_new_thread(self.serve, ())

    # The connection to the simulation.

    def send(self, message):
        payload = json.dumps(message).encode()
        with self.writing:
            self.connection.sendall(_LENGTH.pack(len(payload)) + payload)

    def receive(self):
        return json.loads(self.take(_LENGTH.unpack(self.take(_LENGTH.size))[0]))

    def take(self, count):
        got = b""
        while len(got) < count:
            piece = self.connection.recv(count - len(got))
            if not piece:
                raise EOFError
            got += piece
        return got

    def serve(self):
        """Answers the simulation, in a thread of its own, until the connection ends; then the process is free."""
        self.exempt.add(_me())
        try:
            while True:
                message = self.receive()
                if "turn" in message:
                    self.turn(message["turn"], message["now"])
                elif "hold" in message:
                    self.hold(message["hold"])
                elif "free" in message:
                    self.free()
                elif "graph" in message:
                    self.send({"graph": self.graph()})
                elif "where" in message:
                    self.send({"where": self.where()})
        except (EOFError, OSError):
            # The simulation is gone; so that nothing stays behind, the process goes, too.
            self.free()
            _sleep(_GRACE_S)
            os._exit(1)

    def hold(self, now):
        with self.lock:
            self.held, self.open, self.now = True, False, now
        for node in list(self.nodes):
            if not node._time_source.ros_time_is_active:
                self.fault("wall clock", f"node {node.get_name()} does not use simulated time: its use_sim_time is false", None)
        # Executors come in from their last free wait.
        since = _wall()
        while self.executors - set(self.polls) and _wall() - since < 2.0:
            _sleep(0.002)
        self.send({"held": len(self.executors)})

    def free(self):
        with self.lock:
            self.held, self.ended = False, True
            for _, _, parked in self.sleepers:
                self.ready(parked, False)
            self.sleepers.clear()
            self.grant()

    def turn(self, marker, now):
        """Begins a turn; `grant` ends it."""
        self.until_arrived(marker)
        with self.lock:
            self.marker, self.sends = marker, 0
            if now > self.now:
                self.now = now
                due = sorted(entry[:2] for entry in self.sleepers if entry[0] <= now)
                asleep = {entry[:2]: entry[2] for entry in self.sleepers}
                self.sleepers = [entry for entry in self.sleepers if entry[0] > now]
                for entry in due:
                    self.ready(asleep[entry], False)
            self.set_time()
            self.open = True
            self.polled.clear()
            self.grant()

    def until_arrived(self, marker):
        """Waits for the marker of a turn: everything that was sent before the turn has arrived then."""
        if self.turns is None:
            return
        from rosgraph_msgs.msg import Clock

        try:
            context = self.own.context
            with self.turns.handle, context.handle:
                while self.held:
                    taken = self.turns.handle.take_message(Clock, False)
                    if taken is not None and taken[0].clock.sec >= marker:
                        return
                    if taken is None:
                        waiting = self.wait_set(1, 0, 0, 0, 0, 0, context.handle)
                        waiting.clear_entities()
                        waiting.add_subscription(self.turns.handle)
                        waiting.wait(int(_LOOK_S * 1e9))
        except Exception:  # The context was shut down: nothing comes any more.
            return

    def set_time(self):
        """Sets the clocks of all nodes of the process at once, so that no node is ahead of another."""
        from rclpy.clock_type import ClockType
        from rclpy.time import Time

        moment = Time(nanoseconds=self.now, clock_type=ClockType.ROS_TIME)
        for source in sorted(self.sources, key=lambda source: source._keeper_serial):
            if source.ros_time_is_active and source._last_time_set != moment:
                source._last_time_set = moment
                for clock in list(source._associated_clocks):
                    clock.set_ros_time_override(moment)

    # The baton. These are called with the lock.

    def ready(self, parked, woken=True):
        """Puts a waiting thread into the queue."""
        if not parked.queued:
            parked.queued, parked.woken = True, woken
            self.queue.append(parked)

    def grant(self):
        """Gives the baton to the next thread if it is free. If there is none, the turn is over."""
        if not self.held:
            waiting, self.queue, self.holder = self.queue, deque(), None
            for parked in waiting:
                self.begin(parked)
            for parked in self.polls.values():
                parked.wake.release()
            self.polls.clear()
            return
        if not self.open or self.holder is not None:
            return
        for place, parked in enumerate(self.queue):
            if parked.work is None or parked.pool.active < parked.pool.most:
                del self.queue[place]
                if parked.work is None:
                    self.activity += 1
                self.holder = parked.ident or -1
                self.begin(parked)
                return
        for ident, parked in self.polls.items():
            if self.polled.get(ident) != self.activity:
                del self.polls[ident]
                self.holder = ident
                parked.wake.release()
                return
        if self.foreign == 0:
            self.open = False
            faults, self.faults = self.faults, []
            marked = self.sends > 0 and self.marks is not None and self.mark()
            self.send({"idle": self.marker, "sends": self.sends, "marked": marked, "faults": faults})

    def begin(self, parked):
        if parked.work is None:
            parked.wake.release()
        elif parked.pool.active < parked.pool.most:
            parked.pool.start(parked)
        else:
            self.queue.append(parked)

    def mark(self):
        """Sends a message behind all others of this turn, so that the simulation knows when they have arrived.

        Returns whether it could.
        """
        from rosgraph_msgs.msg import Clock

        message = Clock()
        message.clock.sec, message.clock.nanosec = self.marker, os.getpid()
        try:
            with self.marks.handle:
                self.publish(self.marks.handle, message)
        except Exception:  # The context was shut down.
            return False
        return True

    # Waiting.

    def park(self, parked, seconds=None, until=None):
        """Gives the baton away and waits until `parked` is woken, at most for some seconds or until a simulated time.

        Returns whether it was woken, and not by the time.
        """
        asleep = False
        while not asleep:
            if self.ended and until is not None:
                return False
            with self.lock:
                if self.held:
                    if seconds is not None:
                        until = self.now + max(1, int(seconds * 1e9))
                    if until is not None and not parked.queued:
                        if until <= self.now:
                            self.ready(parked, False)
                        self.serial += 1
                        self.sleepers.append((until, self.serial, parked))
                    if self.holder == _me():
                        self.holder = None
                    self.grant()
                    asleep = True
            if asleep:
                parked.wake.acquire()
            else:
                since = _wall()
                if parked.wake.acquire(True, _LOOK_S if seconds is None else min(_LOOK_S, max(seconds, 0.0))):
                    return parked.woken
                if seconds is not None:
                    seconds -= _wall() - since
                    if seconds <= 0.0:
                        return False
        if until is not None:
            with self.lock:
                self.sleepers = [entry for entry in self.sleepers if entry[2] is not parked]
        return parked.woken

    def wake(self, parked):
        with self.lock:
            self.ready(parked)
            self.grant()

    def enter(self):
        """A thread takes part from now on."""
        with self.lock:
            if not self.held or self.holder == _me():
                return
            parked = Parked()
            self.ready(parked)
            self.grant()
        parked.wake.acquire()

    def leave(self):
        """A thread ends."""
        with self.lock:
            if self.holder == _me():
                self.holder = None
                self.grant()

    def managed(self):
        """Whether waiting of this thread is waiting for others of the process."""
        return _me() not in self.exempt

    def wait(self, wait_set, timeout_ns):
        """An executor waits for work; it may return without any, and then builds a new set and comes again."""
        me = _me()
        if not self.held:
            self.executors.add(me)
            limit = int(_LOOK_S * 1e9)
            wait_set.poll(limit if timeout_ns < 0 else min(limit, timeout_ns))
            if self.held:
                wait_set.clear_entities()
            return
        self.executors.add(me)
        if self.holder != me or self.polled.get(me) == self.activity:
            parked = Parked()
            with self.lock:
                if not self.held:
                    return
                self.polls[me] = parked
                if self.holder == me:
                    self.holder = None
                self.grant()
            parked.wake.acquire()
            if not self.held or wait_set.built != self.activity:
                # Entities may have come and gone: the executor builds the set anew, with the baton.
                wait_set.clear_entities()
                return
        wait_set.poll(0)
        found = {kind: set(wait_set.ready_entities(kind)) for kind in _KINDS}
        if timeout_ns > 0 and wait_set.timers:
            found["timer"].discard(wait_set.timers[-1])
            wait_set.limited = True
        # Timers of rcl's own that do nothing, see `_patient`.
        found["timer"].difference_update(
            pointer for pointer in found["timer"].difference(wait_set.timers) if self.tried("timer", pointer)
        )
        if any(found.values()):
            self.activity += 1
            self.deadlines.pop(me, None)
            return
        self.polled[me] = self.activity
        if timeout_ns > 0 and self.now >= self.deadlines.setdefault(me, self.now + timeout_ns):
            del self.deadlines[me]
            self.activity += 1
            wait_set.expired = True

    def tried(self, kind, which):
        """Whether something was ready more than twice at this moment."""
        moment, tries = self.tries.get((kind, which), (0, 0))
        self.tries[kind, which] = (self.now, tries + 1 if moment == self.now else 1)
        return self.tries[kind, which][1] > 2

    # Nodes that can't be kept in step.

    def fault(self, kind, words, frame):
        """Notes something that can't be kept in step, once."""
        if (kind, words) not in self.noted:
            self.noted.add((kind, words))
            self.faults.append({"kind": kind, "words": words, "place": place_of(frame) if frame else ""})

    def sent(self):
        """Something is sent by the node's code."""
        self.sends += 1
        if self.held and self.holder != _me() and _me() not in self.exempt:
            name = threading.current_thread().name
            self.fault("own thread", f"thread {name} sends messages while its process waits for its turn", sys._getframe(2))

    def where(self):
        """The place at which the process computes or waits: of the thread with the baton, or of all."""
        frames = sys._current_frames()
        if self.holder in frames:
            return place_of(frames[self.holder])
        return "; ".join(filter(None, (place_of(frame) for ident, frame in frames.items() if ident not in self.exempt)))

    def graph(self):
        """Which topics the process publishes and the services that it calls, with the number of its matches."""
        found = []
        for node in sorted(self.nodes, key=lambda node: node._keeper_serial):
            try:
                for publisher in list(node.publishers):
                    found.append(["publisher", publisher.topic_name, publisher.get_subscription_count()])
                for client in list(node.clients):
                    found.append(["client", client.service_name, int(client.service_is_ready())])
                for waitable in list(node.waitables):
                    if hasattr(waitable, "server_is_ready"):
                        goals = node.resolve_service_name(f"{waitable._action_name}/_action/send_goal")
                        found.append(["client", goals, int(waitable.server_is_ready())])
            except Exception:  # A node that is being destroyed has nothing to match.
                continue
        ours = self.marks.get_subscription_count() if self.marks is not None else 1
        found.append(["publisher", MARK, ours])
        faults, self.faults = self.faults, []
        return {"faults": faults, "nodes": [node.get_fully_qualified_name() for node in self.nodes], "executors": len(self.executors), "ends": found}


def place_of(frame):
    """The innermost line of the node's own code."""
    while frame is not None:
        file = frame.f_code.co_filename
        if not file.startswith((STANDARD, "<")) and "/rclpy/" not in file and os.path.dirname(file) != os.path.dirname(__file__):
            return f"{os.path.basename(file)}, line {frame.f_lineno}, in {frame.f_code.co_name}"
        frame = frame.f_back
    return ""
