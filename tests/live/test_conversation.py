"""Words of services with their times, in the motion of a voice agent."""

import asyncio

import numpy as np

from lipmotion_agents.conversation import Conversation


def test_words_with_odd_times_do_no_harm() -> None:
    sound = np.zeros(16_000, "<i2").tobytes()
    odd: list[tuple[str, float, float | None]] = [
        ("mama", np.nan, 0.2),
        ("mama", -1.0, 0.3),
        ("mama", 0.2, 0.1),
        ("two words", 0.4, 0.5),
        ("mama", 0.4, np.inf),
        ("papa", 0.5, 0.9),
        ("\u5988\u5988", 0.9, 0.95),
        ("", 0.95, None),
        ("mama", np.inf, None),
    ]

    async def speak() -> list[float]:
        conversation = Conversation()
        conversation.add_words(odd)
        frames = await conversation.push(sound, 16_000, 1, at_rest=True)
        conversation.add_words([("mama", 0.1, 0.2)])
        return [frame["viseme_PP"] for frame in frames + conversation.finish()]

    closed = asyncio.run(speak())
    assert min(max(closed[:15]), max(closed[25:45])) > 0.8
