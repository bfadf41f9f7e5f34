"""Residuals of the laws of contact, those of equation 15 in Le Lidec et al., "Contact Models in Robotics: a Comparative
Analysis", arXiv 2304.06372: a contact has a gap or a force (Signorini), friction stays inside its cone (Coulomb), and
where a contact slips, friction takes as much power as the cone allows (maximum dissipation)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from smartmesh_ros.terrain.grid import FloatArray
from studies.engines.engine import Contacts

GRAVITY = 9.81
# Contacts count that carry more than this share of the weight. They slip above this speed [m/s]: maps leave open by up
# to 6 cm/s how ground that tilts under a body moves along x and y.
PRESSED, SLIPS = 0.01, 0.1
length = partial(np.linalg.norm, axis=-1)


class Residuals(NamedTuple):
    """Residuals of P contacts, each (P,).

    ``signorini``: the smaller of the gap after the step, relative to how far a body falls in a step from rest, and the
    normal force relative to the weight. ``normal_speeds`` [m/s]: towards or away from the ground. ``depths`` [m]: after
    the step. ``beyond``: friction outside the cone, relative to its radius. Where a contact slips, else NaN: ``angles``
    [rad] between friction and the direction against slip, ``used``: friction relative to the cone's radius, and
    ``dissipated``: its power relative to the largest. All zero where the laws hold; ``used`` and ``dissipated`` one.
    """

    signorini: FloatArray
    normal_speeds: FloatArray
    depths: FloatArray
    beyond: FloatArray
    angles: FloatArray
    used: FloatArray
    dissipated: FloatArray


def residuals(contacts: Contacts, weight: float, friction: float, dt: float) -> Residuals:
    """Return the residuals of the contacts that press in a step of ``dt`` [s], of bodies of one ``weight`` [N] and
    coefficient of ``friction``; their velocities are relative to the ground."""
    pressed = contacts.normal_forces > PRESSED * weight
    normals, gaps, velocities, forces, frictions = (np.asarray(column[pressed], np.float64) for column in contacts[2:])
    normal_speeds = np.sum(velocities * normals, axis=1)
    against = normal_speeds[:, None] * normals - velocities  # the direction against slip
    gaps = gaps + dt * normal_speeds
    used = length(frictions) / (friction * forces)
    angles = np.arctan2(length(np.cross(frictions, against)), np.sum(frictions * against, axis=1))
    slipping = np.where(length(against) > SLIPS, 1.0, np.nan)
    return Residuals(
        signorini=np.minimum(np.maximum(gaps, 0.0) / (GRAVITY * dt**2), forces / weight),
        normal_speeds=np.abs(normal_speeds),
        depths=np.maximum(-gaps, 0.0),
        beyond=np.maximum(used - 1.0, 0.0),
        angles=slipping * angles,
        used=slipping * used,
        dissipated=slipping * used * np.cos(angles),
    )


def joined(parts: Sequence[Residuals]) -> Residuals:
    """Return the residuals of several steps as one."""
    return Residuals(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def spread(ends_w: FloatArray) -> tuple[float, float]:
    """Return the standard deviation of positions (N, 3) about their mean, and the largest distance of two of them."""
    deviation = np.sqrt(np.mean(length(ends_w - ends_w.mean(axis=0)) ** 2))
    return float(deviation), float(length(ends_w[:, None] - ends_w).max())
