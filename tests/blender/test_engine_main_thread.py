"""GPU work that a render thread hands to the main thread: results, errors, cancelling, a main thread that is gone."""

import gc
import threading
import time
import weakref

import pytest

from rebound import main_thread as module
from rebound.main_thread import BUSY_INTERVAL, IDLE_INTERVAL, Cancelled, MainThread, MainThreadError


def never():
    return False


class Worker(threading.Thread):
    """A render thread that asks for one piece of work."""

    def __init__(self, work):
        super().__init__(daemon=True)
        self.work, self.result, self.error = work, None, None
        self.start()

    def run(self):
        try:
            self.result = self.work()
        except Exception as error:  # noqa: BLE001  told to the test
            self.error = error


def tick_until_done(main_thread, worker, seconds=10):
    end = time.monotonic() + seconds
    while worker.is_alive() and time.monotonic() < end:
        main_thread.tick()
        time.sleep(0.001)
    assert not worker.is_alive()


def test_work_runs_on_the_main_thread_and_returns():
    main_thread = MainThread()
    worker = Worker(lambda: main_thread.run(threading.current_thread, never))
    tick_until_done(main_thread, worker)
    assert worker.result is threading.main_thread()


def test_main_thread_does_not_wait_for_itself():
    assert MainThread().run(lambda: 7, never) == 7


def test_error_is_raised_where_it_is_waited_for():
    main_thread = MainThread()
    worker = Worker(lambda: main_thread.run(lambda: 1 / 0, never))
    tick_until_done(main_thread, worker)
    assert isinstance(worker.error, ZeroDivisionError)
    main_thread.tick()  # and the timer lives on


class Resource:
    """Stands for a GPU object: it must die on the main thread."""


class BrokenError(Exception):
    """An error that can be watched."""


@pytest.fixture
def no_collector():
    """What dies here dies because nothing refers to it, not because the collector came by, on whatever thread."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def test_error_keeps_nothing_of_the_main_thread_alive(no_collector):
    main_thread, resources = MainThread(), []

    def build():
        resource = Resource()
        resources.append(weakref.ref(resource))
        raise BrokenError("made by the test")

    def work():
        whole = Resource()
        resources.append(weakref.ref(whole))
        try:
            build()
        except BrokenError as error:
            raise ZeroDivisionError from error

    worker = Worker(lambda: main_thread.run(work, never))
    tick_until_done(main_thread, worker)
    assert isinstance(worker.error, ZeroDivisionError), "the render thread has the error"
    assert len(resources) == 2 and not any(resource() for resource in resources)


def test_error_is_in_no_cycle(no_collector):
    main_thread, errors = MainThread(), []

    def work():
        error = BrokenError("made by the test")
        errors.append(weakref.ref(error))
        raise error

    worker = Worker(lambda: main_thread.run(work, never))
    tick_until_done(main_thread, worker)
    assert isinstance(worker.error, BrokenError)
    worker.error = None
    assert errors[0]() is None


def test_cancelled_work_is_never_begun():
    main_thread, begun = MainThread(), []
    worker = Worker(lambda: main_thread.run(lambda: begun.append(1), lambda: True))
    worker.join(5)
    assert isinstance(worker.error, Cancelled)
    main_thread.tick()
    assert not begun


def test_begun_work_is_waited_for_though_cancelled():
    main_thread = MainThread()
    begun = threading.Event()

    def work():
        begun.set()
        time.sleep(0.3)
        return "done"

    worker = Worker(lambda: main_thread.run(work, begun.is_set))
    tick_until_done(main_thread, worker)
    assert worker.result == "done"


def test_main_thread_that_does_not_answer_is_given_up():
    worker = Worker(lambda: MainThread().run(lambda: 1, never, patience=0.2))
    worker.join(5)
    assert isinstance(worker.error, MainThreadError)
    assert "did not answer" in str(worker.error)


def test_posted_work_is_done_later_and_its_error_is_logged(caplog):
    main_thread, done = MainThread(), []
    worker = Worker(lambda: (main_thread.post(lambda: 1 / 0), main_thread.post(lambda: done.append(1))))
    worker.join(5)
    assert not done
    main_thread.tick()
    assert done == [1]
    assert [r.exc_info[0] for r in caplog.records] == [ZeroDivisionError]


def test_later_work_waits_for_the_timer_even_on_the_main_thread():
    main_thread, done = MainThread(), []
    main_thread.later(lambda: done.append(1))
    assert not done
    main_thread.tick()
    assert done == [1]


@pytest.mark.parametrize(("work", "interval"), [(False, IDLE_INTERVAL), (True, BUSY_INTERVAL)])
def test_timer_is_fast_only_while_there_is_work(work, interval):
    main_thread = MainThread()
    if work:
        main_thread.later(lambda: None)
    assert main_thread.tick() == interval


def test_viewports_are_redrawn_once_when_a_render_ends(monkeypatch):
    main_thread, redrawn = MainThread(), []
    monkeypatch.setattr(module, "_redraw_viewports", lambda: redrawn.append(1))
    monkeypatch.setattr(module, "BUSY_AFTER_JOB", 0.05)
    main_thread.tick()
    main_thread.later(lambda: None)
    main_thread.tick()
    assert main_thread.is_busy() and not redrawn
    time.sleep(0.06)
    main_thread.tick()
    main_thread.tick()
    assert not main_thread.is_busy() and redrawn == [1]


def test_one_tick_is_bounded():
    main_thread, done = MainThread(), []
    for _ in range(10):
        main_thread.later(lambda: (time.sleep(0.02), done.append(1)))
    main_thread.tick()
    assert 1 <= len(done) <= 3
