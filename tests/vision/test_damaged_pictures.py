"""Damaged pictures are found, and rare mouths that come and go slowly are not among them."""

import numpy as np
import pytest

pytest.importorskip("cv2", reason="the extra 'video' is not installed")

from functools import partial

import cv2

from lipmotion.motion.frame_labels import find_runs
from lipmotion_faces.tracking.damaged_pictures import describe_damage, find_damaged, find_repeated

FRAMES, RATE_HZ = 75, 25.0


def mouths(seed: int, *, rare: bool = False) -> np.ndarray:
    """Return pictures of a mouth that opens and closes; a rare one goes aside, slowly [shape=(75, 56, 72, 3)]."""
    chance = np.random.default_rng(seed)
    y, x = np.mgrid[:56, :72].astype(float)
    opening = 3 + 5 * np.abs(np.sin(np.arange(FRAMES) / chance.uniform(4, 8)))
    aside = 14 * np.sin(np.arange(FRAMES) * np.pi / FRAMES) if rare else np.zeros(FRAMES)
    skin = 130 + 12 * np.sin(x / 4) * np.cos(y / 5)
    pictures = []
    for high, right in zip(opening, aside, strict=True):
        inside = np.clip(1.5 - ((x - 36 - right) / 22) ** 2 - ((y - 28) / high) ** 2, 0, 1)
        pictures.append(skin - 70 * inside + chance.normal(0, 1, x.shape))
    return np.repeat(np.clip(pictures, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


def test_smeared_blurred_and_dark_mouths_are_found_and_a_rare_one_is_not():
    clips = [mouths(seed) for seed in range(12)] + [mouths(20, rare=True)]
    smear = np.random.default_rng(1).normal(0, 60, (56, 72, 1)).cumsum(axis=0) / 8
    clips[3][30:48] = np.clip(clips[3][30:48] * 0.3 + 90 + smear, 0, 255)
    clips[5][10:40] = [cv2.GaussianBlur(picture, (0, 0), 1.2) for picture in clips[5][10:40]]
    clips[8][50:] //= 4
    damage = find_damaged([partial(np.copy, clip) for clip in clips], [np.ones(FRAMES, bool)] * 13, [RATE_HZ] * 13)
    found = {
        n: {k: find_runs(mask).tolist() for k, mask in each.items() if mask.any()} for n, each in enumerate(damage)
    }
    assert {number: set(kinds) for number, kinds in found.items() if kinds} == {
        3: {"smeared"},
        5: {"blurred"},
        8: {"dark"},
    }
    assert found[3]["smeared"] == [[30, 48]]
    assert found[8]["dark"] == [[50, 75]]
    assert describe_damage(damage[3], np.arange(FRAMES) / RATE_HZ) == ("smeared pictures: 1.20 to 1.88 s",)


def test_little_footage_is_compared_with_nothing():
    clips = [mouths(0), mouths(1)]
    clips[0][30:48] = 255 - clips[0][30:48]
    damage = find_damaged([partial(np.copy, clip) for clip in clips], [np.ones(FRAMES, bool)] * 2, [RATE_HZ] * 2)
    assert not damage[0]["smeared"].any()


def test_frozen_pictures_and_doubled_ones_are_told_apart():
    changes = [np.inf, *np.random.default_rng(2).uniform(0.6, 1.2, 80)]
    changes[8] = changes[16] = 0.02
    changes[20:30] = [0.0] * 10
    changes[30] = 3.0
    changes[33:39] = [0.05] * 6  # somebody stands still
    repeated, frozen = find_repeated(changes, RATE_HZ)
    assert find_runs(frozen).tolist() == [[20, 30]]
    assert find_runs(repeated).tolist() == [[8, 9], [16, 17], [20, 30]]
    assert not find_repeated([np.inf, 0.0], RATE_HZ)[0].any()
