"""Workers that die, hang or run out of memory cost their own run, and no other."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import psutil
import pytest
from support import hostile_laws
from support.suites import bits, run_suite, suite_of

import mobman as mm
from mobman.benchmark import workers
from mobman.benchmark.runner import Again, Ended
from mobman.benchmark.store import Store
from mobman.controllers.protocol import controllers
from mobman.errors import MobmanError
from mobman.simulation.record import load_record

HOSTILE = {
    "killed": hostile_laws.Killed,
    "leaves": hostile_laws.Leaves,
    "leaves-quietly": hostile_laws.LeavesQuietly,
    "segfaults": hostile_laws.Segfaults,
    "stops": hostile_laws.Stops,
    "forks": hostile_laws.Forks,
    "swells": hostile_laws.Swells,
    "talks": hostile_laws.Talks,
    "slow": hostile_laws.Slow,
    "loops": hostile_laws.Loops,
    "hangs": hostile_laws.Hangs,
    "fills": hostile_laws.Fills,
    "raises": hostile_laws.Raises,
    "exits": hostile_laws.Exits,
    "diverges": hostile_laws.Diverges,
    "killed-once": hostile_laws.KilledOnce,
}


@pytest.fixture(autouse=True)
def hostile(monkeypatch):
    mm.list_controllers()  # so that what is there is found before, and these alone go after
    for name, law in HOSTILE.items():
        monkeypatch.setitem(controllers._items, name, law)


def run(suite, folder, **options):
    """Reasons and numbers of tries, by law."""
    tries: dict[str, int] = {}
    reasons: dict[str, str] = {}

    def note(event):
        if isinstance(event, Again):
            tries[event.run.law] = tries.get(event.run.law, 1) + 1
        if isinstance(event, Ended):
            tries.setdefault(event.outcome.run.law, 1)
            if event.outcome.status == "failed":
                reasons[event.outcome.run.law] = event.outcome.message

    run_suite(suite, folder, on_event=note, **options)
    return reasons, tries


def test_each_loss_is_told_and_costs_nothing_else(tmp_path):
    again = ["killed", "leaves", "leaves-quietly", "segfaults", "fills", "swells"]
    laws = [*again, "raises", "talks", "exits", "diverges"]
    suite = suite_of(["pseudo-inverse", *laws])
    reasons, tries = run(suite, tmp_path / "all", workers=2)
    assert reasons == {
        "killed": "its worker process was ended by SIGKILL (out of memory?); tried 2 times",
        "leaves": "its worker process ended with exit status 7; tried 2 times",
        "leaves-quietly": "its worker process ended with exit status 0; tried 2 times",
        "segfaults": "its worker process was ended by SIGSEGV; tried 2 times",
        "fills": "ran out of memory; tried 2 times",
        "swells": "ran out of memory; tried 2 times",
        "raises": "RuntimeError: a bug of its own",
        "talks": reasons["talks"],
        "exits": "MobmanError: at t = 0 s: the code of the controller, the task or the platform "
        "called sys.exit (SystemExit: 3)",
    }
    assert reasons["talks"].startswith("RuntimeError: many words many words")
    assert len(reasons["talks"]) < 2100
    assert tries == {law: 1 + (law in again) for law in ["pseudo-inverse", *laws]}
    store = Store(tmp_path / "all")
    assert len(store.failures) == 9
    statuses = {
        run.law: load_record(store.path(run)).status for run in suite.runs() if store.done(run)
    }
    assert statuses == {"pseudo-inverse": "ok", "diverges": "diverged"}
    undisturbed = suite_of(["pseudo-inverse"])
    run_suite(undisturbed, tmp_path / "one", workers=1)
    ((name, alone),) = bits(tmp_path / "one", undisturbed).items()
    assert bits(tmp_path / "all", undisturbed) == {name: alone}


def test_what_takes_too_long_is_told(tmp_path):
    """Alone: on a busy machine a sound run may take as long as the limit, too."""
    laws = ["loops", "hangs", "stops"]
    reasons, tries = run(suite_of(laws), tmp_path, workers=3, time_limit=1.0)
    assert reasons == dict.fromkeys(laws, "took longer than its time limit of 1 s; tried 2 times")
    assert tries == dict.fromkeys(laws, 2)


def test_a_child_that_a_law_forks_answers_for_nobody(tmp_path):
    mark = tmp_path / "child"
    forks = {"law": "forks", "gains": {"mark": str(mark)}}
    plain = {"law": "pseudo-inverse"}
    suite = suite_of([], seeds=3, controllers={"forks": forks, "plain": plain})
    left = []

    def look(event):
        """Whether the child lives on, once the run is over."""
        if isinstance(event, Ended) and event.outcome.run.law == "forks":
            with contextlib.suppress(psutil.NoSuchProcess):
                child = psutil.Process(int(mark.read_text()))
                for _ in range(100):
                    if child.status() == psutil.STATUS_ZOMBIE:
                        return
                    time.sleep(0.1)
                left.append(child)

    summary = run_suite(suite, tmp_path / "r", workers=1, on_event=look)
    assert not summary.failed
    assert not left
    store = Store(tmp_path / "r")
    for each in suite.runs():
        record = store.record(each)
        assert (record.spec["law"], record.seed) == (each.law, each.seed)
        assert np.any(record.torque) == (each.law != "forks")


def test_a_killed_fork_server_costs_no_run(tmp_path):
    suite = suite_of(["pseudo-inverse"], seeds=6, duration=0.3)
    again, orphans = [], []

    def strike(event):
        if isinstance(event, Ended) and not orphans:
            children = psutil.Process().children()
            servers = [p for p in children if "forkserver" in " ".join(p.cmdline())]
            for server in servers:
                orphans.extend(server.children())
                server.kill()
        if isinstance(event, Again):
            again.append(event.reason)

    summary = run_suite(suite, tmp_path / "r", workers=2, on_event=strike)
    assert not summary.failed
    assert len(summary.outcomes) == 6
    assert len(again) <= 2
    assert len(orphans) >= 2
    _, alive = psutil.wait_procs(orphans, timeout=20)
    assert not alive


def test_a_worker_that_dies_once_costs_nothing(tmp_path):
    marked = {"law": "killed-once", "gains": {"mark": str(tmp_path / "mark")}}
    plain = {"law": "pseudo-inverse"}
    suite = suite_of([], seeds=3, controllers={"marked": marked, "plain": plain})
    reasons, tries = run(suite, tmp_path / "r", workers=2)
    assert not reasons
    assert tries == {"killed-once": 2, "pseudo-inverse": 1}
    assert len(bits(tmp_path / "r", suite)) == 6


def test_an_executor_that_breaks_as_a_whole_blames_the_culprit_alone(tmp_path):
    suite = suite_of(["killed", "pseudo-inverse"], seeds=2)
    pool = lambda: ProcessPoolExecutor(2, mp_context=get_context("forkserver"))  # noqa: E731
    reasons, _ = run(suite, tmp_path / "r", executor=pool)
    assert reasons == {"killed": "its worker process died; tried 2 times"}
    assert set(Store(tmp_path / "r").failures) == {
        each.run_id for each in suite.runs() if each.law == "killed"
    }


def test_an_executor_that_cannot_be_replaced_ends_the_suite_clearly(tmp_path):
    suite = suite_of(["pseudo-inverse", "killed"])
    with (
        ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as pool,
        pytest.raises(
            MobmanError, match=r"the executor broke .* 1 of 2 runs were done and are kept"
        ),
    ):
        run_suite(suite, tmp_path / "r", executor=pool)
    assert run_suite(suite_of(["pseudo-inverse"]), tmp_path / "r", workers=1).skipped == 1


def test_threads_heed_the_time_limit(tmp_path):
    suite = suite_of(["slow", "pseudo-inverse"], duration=0.2)
    with ThreadPoolExecutor(1) as pool:
        reasons, _ = run(suite, tmp_path / "r", executor=pool, time_limit=0.5)
    assert reasons == {"slow": "took longer than its time limit of 0.5 s; tried 2 times"}


def test_only_mobmans_own_laws_are_loaded_ahead(monkeypatch):
    """A user's may hang or end the process, which must cost its own runs only."""
    asked = []

    class Asks(hostile_laws._Law):
        def act(self):
            asked.append(self)

    monkeypatch.setitem(controllers._items, "asks", Asks)
    monkeypatch.setattr(workers, "_loaded", set())
    workers.preload()
    assert not asked
    mm.simulate("youbot", "asks", "circle", duration=1e-3)
    assert asked


def test_a_reply_for_another_run_is_not_kept(tmp_path):
    class Mixed(ThreadPoolExecutor):
        """Gives each run the result of the first."""

        first = None

        def submit(self, function, *args):
            self.first = self.first or super().submit(function, *args)
            return super().submit(self.first.result)

    suite = suite_of(["pseudo-inverse"], seeds=3)
    with Mixed(1) as pool:
        reasons, _ = run(suite, tmp_path / "r", executor=pool)
    first, *others = suite.runs()
    assert Store(tmp_path / "r").done(first)
    assert reasons["pseudo-inverse"] == f"a worker answered for another run, {first.run_id}"
    assert not any(Store(tmp_path / "r").done(other) for other in others)


def test_a_law_that_cannot_be_sent_is_told(tmp_path, monkeypatch):
    class Local(hostile_laws._Law):
        def act(self):
            pass

    monkeypatch.setitem(controllers._items, "local", Local)
    reasons, _ = run(suite_of(["local", "pseudo-inverse"]), tmp_path / "r", workers=1)
    assert list(reasons) == ["local"]
    assert "controller 'local' cannot be sent to another process" in reasons["local"]
    with ThreadPoolExecutor(1) as pool:  # it need not be sent
        assert not run(suite_of(["local"]), tmp_path / "t", executor=pool)[0]


def test_a_folder_that_cannot_be_written_stops_the_suite(tmp_path, monkeypatch):
    suite = suite_of(["pseudo-inverse"], seeds=20)
    keep, kept = Store.keep, []

    def full_after_three(self, run, content):
        if len(kept) == 3:
            raise MobmanError("cannot write x.h5: No space left on device")
        keep(self, run, content)
        kept.append(run)

    monkeypatch.setattr(Store, "keep", full_after_three)
    with pytest.raises(MobmanError, match=r"No space left on device; .* 3 of 20 runs were done"):
        run_suite(suite, tmp_path / "r", workers=2)
    monkeypatch.undo()
    assert run_suite(suite, tmp_path / "r", workers=2).skipped == 3


def test_a_script_that_every_worker_would_run_again_is_told(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import sys\n"
        "from support.suites import run_suite, suite_of\n"
        "run_suite(suite_of(['pseudo-inverse']), sys.argv[1], workers=1)\n"
    )
    done = subprocess.run(
        [sys.executable, script, tmp_path / "r"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("must be under: if __name__ == '__main__'")
