"""Puts the keeper between a node's code and rclpy, and between it and the threads of the standard library.

Methods are replaced before the node's code runs. They are the same in rclpy 7.1 (Jazzy) and 9.1 (Kilted).
"""

import _thread
import concurrent.futures.thread
import copy
import os
import sys
import threading
import time
from collections import deque

from actcheck_keeper import MARK, STANDARD, TURN, Keeper, Parked, Pool


def install(executors, address):
    """Puts the keeper between rclpy and the node. `executors` is the module `rclpy.executors`."""
    from rclpy import clock, node, time_source, timer
    from rclpy.clock_type import ClockType
    from rclpy.impl.implementation_singleton import rclpy_implementation as native
    from rclpy.parameter import Parameter
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    keeper = Keeper(address)
    serial = iter(range(1, 1 << 62))
    keeper.publish, keeper.wait_set = native.Publisher.publish, native.WaitSet

    class WaitSet(native.WaitSet):
        def __init__(self, *counts):
            super().__init__(*counts)
            self.subscriptions, self.timers = [], []
            self.limited = self.expired = False
            self.built = keeper.activity

        def add_subscription(self, handle):
            self.subscriptions.append(handle.pointer)
            return super().add_subscription(handle)

        def add_timer(self, handle):
            self.timers.append(handle.pointer)
            return super().add_timer(handle)

        def poll(self, timeout_ns):
            super().wait(timeout_ns)

        def ready_entities(self, kind):
            return super().get_ready_entities(kind)

        def wait(self, timeout_ns):
            keeper.wait(self, timeout_ns)

        def get_ready_entities(self, kind):
            found = super().get_ready_entities(kind)
            if kind == "timer" and self.limited:
                found = [pointer for pointer in found if pointer != self.timers[-1]]
                if self.expired:
                    found.append(self.timers[-1])
            return found

    native.WaitSet = WaitSet

    # Everything that a node sends is counted: after a turn in which nothing was sent, no other process has work.
    def counted(function):
        def call(*args, **kwargs):
            keeper.sent()
            return function(*args, **kwargs)

        return call

    for kind in ("Publisher", "Client", "Service", "ActionClient", "ActionServer"):
        known = getattr(native, kind)
        for name in dir(known):
            if name.startswith(("send_", "publish", "service_send")):
                setattr(known, name, counted(getattr(known, name)))

    # A multi-threaded executor.
    made = executors.MultiThreadedExecutor.__init__

    def make_executor(self, *args, **kwargs):
        made(self, *args, **kwargs)
        most = self._executor._max_workers
        self._executor.shutdown(wait=False)
        self._executor = Pool(keeper, most)

    executors.MultiThreadedExecutor.__init__ = make_executor

    # Simulated time.
    source_made = time_source.TimeSource.__init__

    def make_source(self, *args, **kwargs):
        self._keeper_serial = next(serial)
        keeper.sources.add(self)
        source_made(self, *args, **kwargs)

    # The time comes with the turns, for all nodes of a process at once.
    time_source.TimeSource.__init__ = make_source
    time_source.TimeSource._subscribe_to_clock_topic = lambda self: None
    sleeps = clock.Clock.sleep_until

    def sleep_until(self, until, context=None):
        if not keeper.managed():
            return sleeps(self, until, context)
        if until.clock_type != self._clock_type:
            raise ValueError("until's clock type does not match this clock's type")
        if self._clock_type == ClockType.ROS_TIME and self.ros_time_is_active:
            keeper.park(Parked(), until=until.nanoseconds)
        else:
            keeper.park(Parked(), seconds=max(0.0, (until - self.now()).nanoseconds / 1e9))
        return self.now() >= until

    clock.Clock.sleep_until = sleep_until

    def sleep(seconds):
        if keeper.managed():
            if seconds < 0:
                raise ValueError("sleep length must be non-negative")
            keeper.park(Parked(), seconds=seconds)
        else:
            time.sleep.native(seconds)

    time.sleep.kept = sleep
    timer_made = timer.Timer.__init__

    def make_timer(self, callback, callback_group, timer_period_ns, clock, **kwargs):
        timer_made(self, callback, callback_group, timer_period_ns, clock, **kwargs)
        if callback is not None and clock.clock_type != ClockType.ROS_TIME:
            words = f"a timer of {timer_period_ns / 1e9:g} s runs by the wall clock"
            keeper.fault("wall clock", words, sys._getframe(1))

    timer.Timer.__init__ = make_timer

    # Nodes: simulated time and reliable messages.
    node_made = node.Node.__init__
    patient = _patient(keeper)

    def make_own(context):
        from rosgraph_msgs.msg import Clock

        qos = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        own = node.Node.__new__(node.Node)
        plain = {"context": context, "start_parameter_services": False, "enable_rosout": False, "use_global_arguments": False}
        node_made(own, f"_actcheck_keeper_{os.getpid()}", **plain)
        keeper.own, keeper.marks = own, publishes(own, Clock, MARK, qos)
        keeper.turns = subscribes(own, Clock, f"{TURN}{os.getpid()}", lambda _: None, qos)

    def make_node(self, *args, **kwargs):
        given = list(kwargs.get("parameter_overrides") or [])
        if not any(parameter.name == "use_sim_time" for parameter in given):
            given.append(Parameter("use_sim_time", Parameter.Type.BOOL, True))
        kwargs["parameter_overrides"] = given
        patient()
        node_made(self, *args, **kwargs)
        self._keeper_serial = next(serial)
        keeper.nodes.add(self)
        if keeper.own is None:
            make_own(self.context)

    node.Node.__init__ = make_node

    def reliable(qos):
        if isinstance(qos, QoSProfile) and qos.reliability in (ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.SYSTEM_DEFAULT):
            qos = copy.copy(qos)
            qos.reliability = ReliabilityPolicy.RELIABLE
        return qos

    publishes, subscribes = node.Node.create_publisher, node.Node.create_subscription

    def create_publisher(self, msg_type, topic, qos_profile, **kwargs):
        return publishes(self, msg_type, topic, reliable(qos_profile), **kwargs)

    def create_subscription(self, msg_type, topic, callback, qos_profile, **kwargs):
        return subscribes(self, msg_type, topic, callback, reliable(qos_profile), **kwargs)

    node.Node.create_publisher, node.Node.create_subscription = create_publisher, create_subscription
    _install_threads(keeper)
    events = getattr(native, "EventsExecutor", None)
    if events is not None:

        def make_events(*args, **kwargs):
            keeper.fault("executor", "EventsExecutor does its work outside Python", sys._getframe(1))
            return events(*args, **kwargs)

        native.EventsExecutor = make_events


def _patient(keeper):
    """Returns a function that makes action servers wait until old results are older than their time.

    The timer for it stays ready at the very moment of that time, since a result is older only afterwards: without a passing
    time, it would be ready for ever.
    """
    done = []

    def make():
        if done:
            return
        done.append(True)
        from rclpy.action import server

        ready = server.ActionServer.is_ready

        def is_ready(self, wait_set):
            answer = ready(self, wait_set)
            if keeper.held and self._is_goal_expired and keeper.tried("server", id(self)):
                self._is_goal_expired = False
                answer = self._is_goal_request_ready or self._is_cancel_request_ready or self._is_result_request_ready
            return answer

        server.ActionServer.is_ready = is_ready

    return make


def _install_threads(keeper):
    """Threads of the node's own: their waiting is waiting for others of the process."""
    condition = threading.Condition
    notifies, waits = condition.notify, condition.wait

    def wait(self, timeout=None):
        if not keeper.managed():
            return waits(self, timeout)
        if not self._is_owned():
            raise RuntimeError("cannot wait on un-acquired lock")
        parked = Parked()
        line = self.__dict__.setdefault("_keeper_line", deque())
        line.append(parked)
        saved = self._release_save()
        try:
            return keeper.park(parked, seconds=timeout)
        finally:
            self._acquire_restore(saved)
            if parked in line:
                line.remove(parked)

    def notify(self, n=1):
        if not self._is_owned():
            raise RuntimeError("cannot notify on un-acquired lock")
        line = self.__dict__.get("_keeper_line", ())
        left = n
        while line and left > 0:
            keeper.wake(line.popleft())
            left -= 1
        if left > 0:
            notifies(self, left)

    def notify_all(self):
        self.notify(len(self._waiters) + len(self.__dict__.get("_keeper_line", ())))

    condition.wait, condition.notify, condition.notify_all = wait, notify, notify_all
    condition.notifyAll = notify_all

    class Lock:
        """A lock of the node's own code: who waits for it gives the baton away."""

        def __init__(self):
            self._raw, self._line = _thread.allocate_lock(), deque()

        def acquire(self, blocking=True, timeout=-1):
            if self._raw.acquire(False):
                return True
            if not blocking:
                return False
            if not keeper.managed():
                return self._raw.acquire(True, timeout)
            while True:
                parked = Parked()
                self._line.append(parked)
                if self._raw.acquire(False):
                    self._line.remove(parked)
                    return True
                woken = keeper.park(parked, seconds=None if timeout < 0 else timeout)
                if self._raw.acquire(False):
                    return True
                if not woken and timeout >= 0:
                    return False

        def release(self):
            self._raw.release()
            if self._line:
                keeper.wake(self._line.popleft())

        def locked(self):
            return self._raw.locked()

        def __enter__(self):
            return self.acquire()

        def __exit__(self, *_):
            self.release()

        def _at_fork_reinit(self):
            self._raw._at_fork_reinit()

    python_rlock, native_rlock = threading._PyRLock, threading.RLock

    class RLock(python_rlock):
        def __init__(self):
            super().__init__()
            self._block = Lock()

    def own_code():
        file = sys._getframe(2).f_code.co_filename
        return not file.startswith((STANDARD, "<")) and "/rclpy/" not in file

    threading.Lock = lambda: Lock() if own_code() else _thread.allocate_lock()
    threading.RLock = lambda: RLock() if own_code() else native_rlock()

    # Threads that are started in a turn take part; those of pools do their work beside the baton, and are waited for.
    thread = threading.Thread
    runs, joins = thread._bootstrap_inner, thread.join

    def bootstrap(self):
        takes_part = keeper.held and self._target is not concurrent.futures.thread._worker
        if takes_part:
            run = self.run

            def entered():
                keeper.enter()
                run()

            self.run = entered
        try:
            runs(self)
        finally:
            for parked in self.__dict__.pop("_keeper_joins", ()):
                keeper.wake(parked)
            keeper.leave()

    def join(self, timeout=None):
        if keeper.held and keeper.managed() and self.is_alive() and self is not threading.current_thread():
            parked = Parked()
            line = self.__dict__.setdefault("_keeper_joins", deque())
            line.append(parked)
            if self.is_alive():
                keeper.park(parked, seconds=timeout)
                if not parked.woken:
                    return
        joins(self, timeout)

    thread._bootstrap_inner, thread.join = bootstrap, join
    pool = concurrent.futures.ThreadPoolExecutor
    submits = pool.submit

    def submit(self, fn, /, *args, **kwargs):
        with keeper.lock:
            keeper.foreign += 1
        future = submits(self, fn, *args, **kwargs)

        # Called after those that wait for the result were woken.
        def done(_):
            with keeper.lock:
                keeper.foreign -= 1
                keeper.grant()

        future.add_done_callback(done)
        return future

    pool.submit = submit
    threading._register_atexit(keeper.leave)
