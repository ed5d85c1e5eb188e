"""Loops over rays in NumPy have the hits of the compiled loops, bit for bit."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.geometry import embree_arrays, embree_kernels, rays_embree
from polarsim.geometry.rays_embree import MovableMesh, MovableScene


@pytest.mark.parametrize("size", [8, 16])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), rays=st.integers(0, 70), common=st.booleans())
def test_both_loops_have_the_same_hits(size, seed, rays, common):
    random = np.random.default_rng(seed)
    corners = random.normal(size=(2, 30, 3))
    faces = np.arange(30).reshape(-1, 3)
    scene = MovableScene([MovableMesh(part, faces, mask) for part, mask in zip(corners, (1, 2), strict=True)])
    origins = np.broadcast_to(random.normal(size=3), (rays, 3)) if common else random.normal(size=(rays, 3))
    directions = random.normal(size=(rays, 3))
    far = random.normal(1, 1, size=rays) if seed % 2 else 2.0
    found = []
    for loops in (embree_kernels, embree_arrays):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rays_embree, "_loops", lambda loops=loops: loops)
            patch.setattr(rays_embree, "packet_size", lambda: size)
            for mask in (1, 2, 3):
                caster = scene.caster(mask)
                hits = caster.intersect(origins, directions)
                found.append([getattr(hits, field.name) for field in fields(hits)])
                found[-1].append(caster.occluded(origins, directions, far))
    for compiled, arrays in zip(found[:3], found[3:], strict=True):
        for one, other in zip(compiled, arrays, strict=True):
            assert one.dtype == other.dtype
            assert one.tobytes() == other.tobytes()
