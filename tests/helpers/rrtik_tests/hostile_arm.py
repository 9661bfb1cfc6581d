"""An arm that does another thing than it is told, and a pilot who holds a joint's key at it through a whole server."""

import queue
import socket
import threading
import time
from contextlib import ExitStack, closing
from types import SimpleNamespace

import numpy as np

from rrtik_ompl.pilot.devices.arm import SimulatedArm
from rrtik_ompl.pilot.devices.line_arm import LineArm, LineServer
from rrtik_ompl.pilot.engine import Engine
from rrtik_ompl.pilot.overlay.virtual_camera import pinhole_camera
from rrtik_ompl.pilot.run import PERIOD_SECONDS, Loop
from rrtik_ompl.pilot.session import Session
from rrtik_ompl.pilot.web.server import PilotServer
from rrtik_tests.browser import PatientLoop
from rrtik_tests.page_by_hand import Page
from rrtik_tests.pilot_session import PLACE, PROBLEM, ROBOT, seen_at


class HostileArm(SimulatedArm):
    """A simulated arm with a fault that can be set while it moves.

    Attributes:
        fault: "other" (the next joint moves in place of the one that is told), "reverse", "jump" (the reading of the
            joint that moves jumps by 34 degrees), "dead", "runaway" (it does not stop), "fast" (by five times),
            "frozen" (its reading stays as it is), "offset" (its first joint reads 34 degrees too much); "" for none.
    """

    def __init__(self, robot=ROBOT, start=PROBLEM.start, fault=""):
        super().__init__(robot, start)
        self.fault = fault
        self._told = None
        self._frozen = None

    def read(self):
        q = super().read()
        self._frozen = (q if self._frozen is None else self._frozen) if self.fault == "frozen" else None
        if self._frozen is not None:
            return self._frozen.copy()
        if self.fault == "offset":
            return q + 0.6 * np.eye(len(q))[0]
        if self.fault == "jump" and self._course is not None:
            return q + 0.6 * np.eye(len(q))[int(np.abs(self._course - q).argmax())] * (-1.0 if q.max() > 0.0 else 1.0)
        if self.fault == "jump" and self._goal is not None:
            joint = self._goal[0]
            q[joint] += 0.6 if q[joint] < 0.0 else -0.6  # to where the joint can be
        return q

    def stop(self):
        if self.fault != "runaway":
            super().stop()

    def _advance_course(self, seconds):
        """All joints are told to move: the next ones do, or backwards, or none, or on and on."""
        step = np.clip(self._course - self._q, -self._rates * seconds, self._rates * seconds)
        if self.fault == "runaway":
            self._told = np.sign(step) if self._told is None else self._told
            step = self._told * self._rates * seconds
        self._q = (
            self._q + {"other": np.roll(step, 1), "reverse": -step, "dead": 0.0 * step, "runaway": step}[self.fault]
        )

    def advance(self, seconds):
        if self.fault == "fast":
            super().advance(5.0 * seconds)
            return
        if self.fault in ("other", "reverse", "dead", "runaway") and self._course is not None:
            self._advance_course(seconds)
            return
        if self.fault in ("", "jump", "frozen", "offset") or self._goal is None:
            super().advance(seconds)
            return
        joint, target = self._goal
        way = np.sign(target - self._q[joint])
        if self.fault == "runaway":
            self._told = self._told or way
            self._q[joint] += self._told * self._rates[joint] * seconds
        elif self.fault != "dead":
            moved, way = ((joint + 1) % self.robot.dof, way) if self.fault == "other" else (joint, -way)
            self._q[moved] += way * self._rates[moved] * seconds


class Undrawn(Engine):
    """An engine whose pictures are not drawn."""

    def camera_picture(self):
        return b"\xff\xd8\xff\xd9"

    def outside_picture(self, anew=False):
        return None


class Seeing:
    """A camera that always sees the same."""

    camera, T_base_camera = pinhole_camera(64, 48), None
    arm_in_picture, lost, hint = True, "", ""
    picture = np.zeros((4, 4, 3), dtype=np.uint8)

    def update(self, session, time):
        session.see([seen_at(PLACE)], time)

    def close(self):
        pass


class Proxy:
    """A line with a constant delay each way [s]."""

    def __init__(self, target, delay):
        self._delay, self._target = delay, target
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                near, _ = self._listening.accept()
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", self._target))
            for one, other in ((near, far), (far, near)):
                one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=self._pump, args=(one, other), daemon=True).start()

    def _pump(self, one, other):
        waiting = []
        one.settimeout(0.002)
        while True:
            try:
                data = one.recv(65536)
                waiting.append((time.monotonic() + self._delay, data))
                if not data:
                    return
            except TimeoutError:
                pass
            except OSError:
                return
            while waiting and waiting[0][0] <= time.monotonic():
                try:
                    other.sendall(waiting.pop(0)[1])
                except OSError:
                    return

    def close(self):
        self._listening.close()


class Pilot:
    """A whole session behind its server, and a page without a browser that holds keys.

    With ``line`` the arm is on the other side of a line of its own and moves by the clock on the wall; without, its
    time is the session's, which waits for a machine that pauses.
    """

    def __init__(self, delay=0.0, line=False):
        self.arm, self._stack = HostileArm(), ExitStack()
        joints, kind, simulated = self.arm, PatientLoop, (self.arm,)
        if line:
            port = self._stack.enter_context(LineServer(self.arm)).port
            joints, kind, simulated = self._stack.enter_context(closing(LineArm(ROBOT, "127.0.0.1", port))), Loop, ()
        self.session = Session(PROBLEM, joints, seed=1)
        self.server = self._stack.enter_context(PilotServer())
        proxy = self._stack.enter_context(closing(Proxy(self.server.port, delay)))
        self._ended = threading.Event()
        loop = kind(Undrawn(self.session, Seeing(), simulated=simulated), self.server)
        self._thread = threading.Thread(target=loop.run, args=(self._ended.is_set,), daemon=True)
        self._thread.start()
        self.page = Page(self.server, port=proxy.port)
        self._state, self._seen, self._picture = {}, None, None
        self._press, self._direction = 0, 1.0
        while self._picture is None or not self._state or self._state["trouble"]:
            self.look(0.1)
        self.look(0.5)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join(10)
        self._stack.close()

    def now(self):
        return time.monotonic()

    def look(self, seconds):
        """Show what comes for a while; returns the last state."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            said = self.page.hear_within(left)
            if isinstance(said, bytes):
                self._picture = float(np.frombuffer(said[1:9], dtype="<f8")[0])
                self.page.say(shown="frame")
            elif said and said["kind"] == "state":
                self._state, self._seen = said, said["stamp"]
                self.page.say(shown="state", stamp=self._seen)
        return self._state

    def say(self, name, **values):
        self.page.say(name=name, seen=self._seen, picture=self._picture, **values)

    def hold(self, seconds, until=lambda state: False, direction=1.0):
        """Press a key that drives the selected joint; the last state."""
        self._press, self._direction = self._press + 1, direction
        return self.go_on(seconds, until)

    def go_on(self, seconds, until=lambda state: False):
        """Hold it on."""
        end = self.now() + seconds
        while self.now() < end and not until(self._state):
            self.say("jog", direction=self._direction, press=self._press)
            self.look(0.04)
        return self._state

    def release(self):
        self.say("release")


class SteppedLoop(Loop):
    """A loop whose clock is set by a test."""

    now = 0.0

    @property
    def time(self):
        return self.now


class Desk:
    """A server and its only page without sockets: what either says reaches the other after a delay [s]."""

    def __init__(self, delay):
        self._delay, self._to_server, self._to_page = delay, [], []
        self.now, self.commands = 0.0, queue.Queue()
        self.clients = OnePage()

    def heard(self):
        return {}

    def say(self, **words):
        """The page says something."""
        self._to_server.append((self.now + self._delay, words))

    def show_state(self, state, executed):
        self._to_page.append((self.now + self._delay, state))

    def show_frame(self, kind, taken, jpeg):
        if kind == "C":
            self._to_page.append((self.now + self._delay, taken))

    def deliver(self):
        """Hand what has arrived to the server, and return what has arrived at the page."""
        while self._to_server and self._to_server[0][0] <= self.now:
            self.commands.put((1, dict(self._to_server.pop(0)[1])))
        arrived = []
        while self._to_page and self._to_page[0][0] <= self.now:
            arrived.append(self._to_page.pop(0)[1])
        return arrived


class OnePage:
    """The pages of a desk: one, which is the pilot."""

    pilot = SimpleNamespace(number=1)

    def __len__(self):
        return 1


class SteppedPilot(Pilot):
    """The same session and the same hands, on a clock that only the hands advance: no load of the machine matters."""

    TICK = PERIOD_SECONDS / 4.0

    def __init__(self, delay=0.0):
        self.arm = HostileArm()
        self.session = Session(PROBLEM, self.arm, seed=1)
        self.page = Desk(delay)
        self._loop = SteppedLoop(Undrawn(self.session, Seeing(), simulated=(self.arm,)), self.page)
        self._ticks = 0
        self._state, self._seen, self._picture = {}, None, None
        self._press, self._direction = 0, 1.0
        self.look(0.6 + 2.0 * delay)

    def __exit__(self, *_):
        pass

    def now(self):
        return self.page.now

    def look(self, seconds):
        """Advance the clock, with a picture every period and commands executed between two pictures."""
        for _ in range(max(round(seconds / self.TICK), 1)):
            self._ticks += 1
            self.page.now = self._loop.now = self._ticks * self.TICK
            for each in self.page.deliver():
                if isinstance(each, dict):
                    self._state, self._seen = each, each["stamp"]
                else:
                    self._picture = each
            if self._ticks % 4 == 0:
                self._loop._step()
            while not self.page.commands.empty():
                self._loop._execute_one(0.0)
        return self._state
