"""What a stranger at the controls can do to an arm, and how soon it answers.

Targets, obstacles, gains, laws, levels, noise and pauses are set at random, often beyond what may
be set; then targets are sent to a running page as a browser sends them::

    python benchmarks/live.py --seconds 60 --seeds 3
    python benchmarks/live.py --latency
    python benchmarks/live.py --rate
"""

from __future__ import annotations

import argparse
import contextlib
import http.client
import json
import os
import threading
import time
from urllib.parse import urlsplit

import numpy as np

from drake_rnn import load_experiment
from drake_rnn.film.encoding import open_browser
from drake_rnn.live.play import Play
from drake_rnn.live.segment import Segment
from drake_rnn.live.session import Session
from drake_rnn.measures import Steps
from live_stranger import Watched, play
from markdown_table import head, row

NAMES = (
    "slc_nephroid_known",
    "adaptive_nephroid",
    "adaptive_jerk",
    "adaptive_pose",
    "slc_nephroid_guarded",
    "adaptive_moving_obstacle",
)
# Motion of the tool that counts as an answer [m], and how far a target is sent [m].
MOVED, AWAY = 1e-3, 0.05
# Size of the window of the page [pixels], and what keeps the browser from any other address.
WINDOW = (1280, 800)
_LOCAL = ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE localhost"]


def print_bounds(names: list[str], seconds: float, seeds: int) -> None:
    """Print how far bounds were exceeded while controls were set at random."""
    head(
        *("experiment", "simulated [s]", "set", "taken over", "largest jump", "position [rad]"),
        *("velocity", "acceleration", "jerk", "least distance [mm]", "times real time"),
    )
    for name in names:
        excess = dict.fromkeys(("position", "velocity", "acceleration", "jerk"), -np.inf)
        jump, distance, settings, taken, began = 0.0, np.inf, 0, 0, time.perf_counter()
        for seed in range(seeds):
            session = Session(load_experiment(name))
            watched = Watched(session)
            settings += play(session, seconds, seed)
            taken += session.takeovers
            jump, distance = max(jump, watched.jump), min(distance, watched.distance)
            excess = {key: max(excess[key], watched.excess[key]) for key in excess}
        rate = seconds * seeds / (time.perf_counter() - began)
        told = [f"{max(0.0, each):.0e}" for each in excess.values()]
        clear = f"{1e3 * distance:.2f}" if np.isfinite(distance) else "-"
        row(name, f"{seconds * seeds:g}", settings, taken, f"{jump:g}", *told, clear, f"{rate:.2g}")


def print_latency(count: int, seconds: float) -> None:
    """Print the rate of a page that plays, and the time from a message to a motion."""
    session, answers = Session(load_experiment("adaptive_nephroid_known")), list[float]()
    session.set("stop", None)
    play = Play(session, "localhost", 0, lambda result: "")
    ended = threading.Event()
    client = threading.Thread(target=_ask, args=(play.url, session, count, answers, ended))
    client.start()
    play.run(ended.is_set)
    client.join()
    again, until = Session(load_experiment("slc_nephroid_known")), time.monotonic() + seconds
    quiet = Play(again, "localhost", 0, lambda result: "")
    quiet.run(lambda: time.monotonic() > until)
    head("message to 1 mm, median [ms]", "largest [ms]", "messages", f"rate over {seconds:g} s")
    ms = 1e3 * np.array(answers)
    row(f"{np.median(ms):.0f}", f"{ms.max():.0f}", ms.size, f"{again.time / seconds:.3f}")
    for each in (play, quiet):
        each.close()


def print_rates(names: list[str], seconds: float) -> None:
    """Print the rates of experiments that play, with no page open and with one in Chromium."""
    head("experiment", "page", f"rate over {seconds:g} s", "load before")
    for name in names:
        for opened in (False, True):
            session, load = Session(load_experiment(name)), os.getloadavg()[0]
            play = Play(session, "localhost", 0, lambda result: "")
            with contextlib.ExitStack() as stack:
                if opened:
                    browser = stack.enter_context(open_browser(WINDOW, _LOCAL))
                    # The page asks this process for itself: that takes until it plays.
                    asking = threading.Thread(target=browser.get, args=(play.url,))
                    asking.start()
                    play.run(lambda asking=asking: not asking.is_alive())
                warm = time.monotonic() + 3.0
                play.run(lambda warm=warm: time.monotonic() > warm)
                began, until = session.time, time.monotonic() + seconds
                play.run(lambda until=until: time.monotonic() > until)
                rate = (session.time - began) / seconds
            play.close()
            row(name, "in Chromium" if opened else "none", f"{rate:.3f}", f"{load:.1f}")


def _ask(
    url: str, session: Session, count: int, answers: list[float], ended: threading.Event
) -> None:
    """Send targets as a page does, and note how long the tool takes to move by a millimetre."""
    place = urlsplit(url)
    connection = http.client.HTTPConnection(place.hostname or "", place.port or 0)

    def post(path: str, body: object, key: str = "") -> bytes:
        connection.request("POST", path, json.dumps(body), {"X-Key": key})
        return connection.getresponse().read()

    key = json.loads(post("/controls", None))["key"]
    kinematics, middle = session.experiment.arm.kinematics(), session.experiment.p_WE_start
    # Contexts belong to the thread that simulates: it hands on where the arm is.
    last = [session.experiment.start]

    def watch(segment: Segment, steps: Steps) -> None:
        last[0] = steps.series("position")[-1].copy()

    session.watch = watch
    try:
        for k in range(count):
            post("/controls", None, key)
            time.sleep(1.5)
            tool, began = kinematics.p_WE(last[0]), time.perf_counter()
            target = middle + AWAY * np.array([0.0, (-1.0) ** k, 0.0])
            post("/set", [["target", target.tolist()]], key)
            while np.linalg.norm(kinematics.p_WE(last[0]) - tool) < MOVED:
                time.sleep(0.002)
                if time.perf_counter() - began > 5.0:
                    break
            answers.append(time.perf_counter() - began)
    finally:
        ended.set()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="simulated by each session")
    parser.add_argument("--seeds", type=int, default=3, help="sessions of each experiment")
    parser.add_argument("--latency", action="store_true", help="measure answers instead")
    parser.add_argument("--rate", action="store_true", help="measure the rate instead")
    parser.add_argument("--experiments", default=",".join(NAMES), help="names, with commas")
    asked = parser.parse_args()
    if asked.latency:
        print_latency(10, 20.0)
    elif asked.rate:
        print_rates(asked.experiments.split(","), 20.0)
    else:
        print_bounds(asked.experiments.split(","), asked.seconds, asked.seeds)


if __name__ == "__main__":
    main()
