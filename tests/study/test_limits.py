"""The limit on requests, by a clock of its own."""

from __future__ import annotations

from lipmotion_studio.study.limits import RateLimit


def test_a_burst_and_then_a_rate() -> None:
    now_s = [100.0]
    limit = RateLimit(2.0, 5, lambda: now_s[0])
    assert [limit.allows("a") for _ in range(7)] == [True] * 5 + [False] * 2
    assert limit.allows("b")
    now_s[0] += 0.5
    assert [limit.allows("a") for _ in range(2)] == [True, False]
    now_s[0] += 60
    assert [limit.allows("a") for _ in range(7)] == [True] * 5 + [False] * 2


def test_nothing_is_kept_of_those_who_have_gone() -> None:
    now_s = [0.0]
    limit = RateLimit(1.0, 2, lambda: now_s[0])
    for asker in range(20_000):
        now_s[0] += 0.01
        assert limit.allows(asker)
    assert len(limit._full_at_s) < 3000
