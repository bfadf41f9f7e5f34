"""Settings of sleeping bodies."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class SleepConfig:
    """When bodies fall asleep and wake.

    ``after`` [s], ``distance`` [m]: a body that rests on something is still if no point of it moved farther than
    ``distance`` for the time ``after``, which grows where gravity is weaker than the Earth's. This is a mean speed of 2
    mm/s. Contacts at rest tremble faster at times, but go nowhere; a ball on a slope of 0.5 degrees moves by 8 mm in
    this time. ``ground`` [m]: a sleeping body wakes when the ground under it has changed by more than this since it
    fell asleep. ``noise``: on maps whose noise is fused, a change may also be this many standard deviations of the
    fused heights; the body follows it asleep. With 3, noise of 5 mm wakes a body about once in five seconds. ``near``
    [m], ``near_share``: bodies whose bounding boxes are closer than ``near`` plus this share of both radii may touch.
    PyBullet itself wakes what is closer than 0.02 radii to an awake body. ``most``: largest number of bodies that fall
    asleep in one update, because each takes 10 us there. ``joint`` [rad/s, m/s]: a robot sleeps only while none of its
    joints is faster, because links without a collision shape are not watched. ``watch`` [s]: each sleeping body and
    link is read once in this time, to notice if it moved.
    """

    after: float = 0.5
    distance: float = 1e-3
    ground: float = 2.5e-4
    noise: float = 3.0
    near: float = 2e-3
    near_share: float = 0.03
    most: int = 100
    joint: float = 0.02
    watch: float = 0.25
