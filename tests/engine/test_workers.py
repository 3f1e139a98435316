"""Claims: sums come in order from as many workers as there are at the moment; nothing is under way once it is over."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from threading import Event, Timer

from nlbench.engine.workers import Part, in_order


class Growing:
    """Workers of which more come; `most` calls wait to be taken at a time. Calls are done when they are asked for."""

    def __init__(self):
        self.at_once, self.waiting, self.most = 1, 0, 0

    def submit(self, first, count):
        self.waiting += 1
        self.most = max(self.most, self.waiting)
        done = Future()
        done.set_result(Part({"block": first, "count": count}, 1.0))
        return done

    def taken(self):
        self.waiting -= 1


def never():
    return False


def test_workers_that_come_later_get_work():
    workers, blocks = Growing(), []
    for number, (first, sums) in enumerate(in_order(workers, 0, 400, 64, never)):
        workers.taken()
        blocks += range(first, first + sums["count"])
        if number == 3:
            assert workers.most <= 2
            workers.at_once = 16
    assert blocks == list(range(400))
    assert workers.most == 32


def test_a_limit_on_calls_is_kept_to():
    workers = Growing()
    workers.at_once = 16
    for _ in in_order(workers, 0, 100, 64, never, ahead=3):
        workers.taken()
    assert workers.most == 3


class Slow:
    """Two threads, whose calls end when told to."""

    def __init__(self):
        self.at_once, self.running, self.may_end = 2, 0, Event()
        self.pool = ThreadPoolExecutor(2)

    def submit(self, first, count):
        return self.pool.submit(self.call, first, count)

    def call(self, first, count):
        if first == 0:
            return Part({}, 1.0)
        self.running += 1
        self.may_end.wait(20)
        self.running -= 1
        return Part({}, 1.0)


def test_who_takes_no_more_waits_for_the_calls_under_way():
    workers = Slow()
    with closing(in_order(workers, 0, 100, 1, never)) as parts:
        next(parts)
        Timer(0.2, workers.may_end.set).start()
    assert workers.running == 0
    workers.pool.shutdown()
