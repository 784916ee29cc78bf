"""Limits on how often somebody may ask."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable


class RateLimit:
    """Allows so many requests a second for each asker, and some more at once.

    rate_hz : requests a second in the long run
    burst   : requests at once after a pause
    clock   : returns the time in seconds
    Of askers whose allowance is full again nothing is kept: the memory is bounded by ``burst / rate_hz`` seconds of
    requests, and askers are few.
    """

    def __init__(self, rate_hz: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate_hz, self._burst, self._clock = rate_hz, burst, clock
        self._full_at_s: dict[Hashable, float] = {}
        self._sweep_at = 1024

    def allows(self, asker: Hashable = "") -> bool:
        """Return whether one more request is allowed, and count it if it is."""
        now_s = self._clock()
        full_at_s = max(self._full_at_s.get(asker, now_s), now_s) + 1 / self._rate_hz
        if full_at_s - now_s > self._burst / self._rate_hz + 1e-9:
            return False
        self._full_at_s[asker] = full_at_s
        if len(self._full_at_s) > self._sweep_at:
            self._full_at_s = {who: at_s for who, at_s in self._full_at_s.items() if at_s > now_s}
            self._sweep_at = 2 * len(self._full_at_s) + 1024
        return True
