# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Ray casting in a world of one fixed mesh and some moving bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from d2lio.simulator.mesh import Mesh
from d2lio.simulator.trajectory import Trajectory

MISS = -1


@dataclass
class Hits:
    """Nearest hits: distance (n,) m (inf: none), cosine of incidence (n,), material (n,)."""

    distance: np.ndarray
    cosine: np.ndarray
    material: np.ndarray

    @classmethod
    def none(cls, count: int) -> Hits:
        """No hit for any of count rays."""
        return cls(np.full(count, np.inf), np.zeros(count), np.full(count, MISS, dtype=np.int64))


class Body:
    """A rigid mesh behind a ray-casting tree."""

    def __init__(self, mesh: Mesh) -> None:
        """Build the tree; the mesh must hold at least one triangle of non-zero area."""
        corners, material = mesh.corners, mesh.material
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normal, axis=1)
        solid = area > 1e-12
        corners, self.material = corners[solid], material[solid]
        self.normal = normal[solid] / area[solid, None]
        # The tree works in float32: centred, it keeps its resolution far from the world's origin.
        self.center = 0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))
        self.corners = corners - self.center
        self.radius = float(np.linalg.norm(self.corners, axis=2).max())
        self.offset = np.einsum("ni,ni->n", self.normal, self.corners[:, 0])
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(self.corners, dtype=np.float32))

    def cast(self, origin: np.ndarray, direction: np.ndarray) -> Hits:
        """Nearest hits of rays with origin and unit direction (n, 3) in the body's frame.

        The tree only chooses the triangle; distance and incidence come from its plane in float64.
        """
        local = origin - self.center
        face = self._scene.run(
            np.ascontiguousarray(local, dtype=np.float32),
            np.ascontiguousarray(direction, dtype=np.float32),
            query="INTERSECT",
        ).astype(np.int64)
        hits = Hits.none(len(origin))
        seen = np.flatnonzero(face >= 0)
        face = face[seen]
        normal = self.normal[face]
        along = np.einsum("ni,ni->n", normal, direction[seen])
        ahead = self.offset[face] - np.einsum("ni,ni->n", normal, local[seen])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ahead / along
        good = np.isfinite(distance) & (distance > 0.0)
        seen, face = seen[good], face[good]
        hits.distance[seen] = distance[good]
        hits.cosine[seen] = np.abs(along[good])
        hits.material[seen] = self.material[face]
        return hits


@dataclass
class Mover:
    """A body on a trajectory of its own (T_world_body)."""

    body: Body
    trajectory: Trajectory

    def cast(
        self, t: np.ndarray, origin: np.ndarray, direction: np.ndarray, reach: float
    ) -> tuple[np.ndarray, Hits]:
        """Indices (m,) of the rays that come near, and their hits, each at its own time t (n,)."""
        middle, _ = self.trajectory.pose(np.array([t[0], t[-1]]))
        slack = (
            self.body.radius
            + np.linalg.norm(middle[1] - middle[0])
            + np.linalg.norm(self.body.center)
        )
        to_body = middle.mean(axis=0) - origin
        far = max(np.linalg.norm(to_body[0]), np.linalg.norm(to_body[-1]))
        travelled = np.linalg.norm(origin[-1] - origin[0])
        if far > reach + slack + travelled:
            return np.empty(0, dtype=np.int64), Hits.none(0)
        along = np.einsum("ni,ni->n", to_body, direction)
        away = np.einsum("ni,ni->n", to_body, to_body) - along**2
        near = np.flatnonzero((away < slack**2) & (along > -slack) & (along < reach + slack))
        position, rotation = self.trajectory.pose(t[near])
        local_origin = np.einsum("nji,nj->ni", rotation, origin[near] - position)
        local_direction = np.einsum("nji,nj->ni", rotation, direction[near])
        return near, self.body.cast(local_origin, local_direction)


@dataclass
class World:
    """What a scene builds: the fixed body, moving bodies, and the sensor rig's trajectory."""

    fixed: Body
    trajectory: Trajectory
    movers: tuple[Mover, ...] = ()

    def cast(self, t: np.ndarray, origin: np.ndarray, direction: np.ndarray, reach: float) -> Hits:
        """Nearest hits of rays fired at t (n,) s; origin, unit direction (n, 3) in the world."""
        hits = self.fixed.cast(origin, direction)
        for mover in self.movers:
            index, other = mover.cast(t, origin, direction, reach)
            nearer = other.distance < hits.distance[index]
            target = index[nearer]
            hits.distance[target] = other.distance[nearer]
            hits.cosine[target] = other.cosine[nearer]
            hits.material[target] = other.material[nearer]
        return hits
