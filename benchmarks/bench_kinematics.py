"""Tip pose and Jacobian of a three-segment arm, one at a time and 10,000 at once, against other libraries.

All compute the same tip, which is checked before anything is timed. soromox draws its backbone along local x,
so its strains are ours with the axes renamed; only two bends and the stretch of a segment are active, so that
its Jacobian is 6 x 9 like ours. It is compiled, warm, in double precision, and its result is waited for.
"""

import subprocess
import sys
from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
from scipy.linalg import expm

from benchmarks.run import Row, compare
from soro_lib.arcs import chain_jacobian, chain_transform, chain_transform_and_jacobian

LENGTHS = np.array([0.12, 0.24, 0.24])
BATCH = 10_000
IMPORT_REPEATS = 5
Computation = Callable[[], Any]


def rows() -> list[Row]:
    """Return the comparisons of the kinematic core."""
    states = configurations(BATCH)
    state = states[0]
    agree("expm", exponentials(state), chain_transform(state))
    agree("expm", all_exponentials(states), chain_transform(states))
    one, many = pytransform3d_poses(states) or (None, None)
    soromox = soromox_kinematics(states) or dict.fromkeys(("pose", "both", "poses", "jacobians"))
    return [
        *compare(
            "tip pose, one at a time",
            lambda: chain_transform(state),
            {
                "soromox": soromox["pose"],
                "pytransform3d": one,
                "scipy.linalg.expm": lambda: exponentials(state),
            },
            goal=25.0,
        ),
        *compare(
            "tip pose and Jacobian, one at a time",
            lambda: chain_transform_and_jacobian(state),
            {"soromox": soromox["both"]},
            goal=50.0,
        ),
        *compare(
            "10,000 tip poses",
            lambda: chain_transform(states),
            {
                "soromox": soromox["poses"],
                "pytransform3d": many,
                "scipy.linalg.expm": lambda: all_exponentials(states),
            },
            unit="ms",
            goal=6.0,
        ),
        *compare(
            "10,000 tip Jacobians, 6 x 9",
            lambda: chain_jacobian(states),
            {"soromox": soromox["jacobians"]},
            unit="ms",
            goal=25.0,
        ),
        import_time("import soro_lib, CPU time", "import soro_lib"),
        import_time(
            "import soro_lib and its four arms, CPU time",
            "from soro_lib.robots import CableDrivenArm, HelixArm, PneumaticArm, SoftGrowingArm",
        ),
    ]


def import_time(name: str, statement: str) -> Row:
    """Return how long an import takes in a fresh interpreter, whose own start is not counted."""
    code = f"import time; start = time.process_time(); {statement}; print(time.process_time() - start)"
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        for _ in range(IMPORT_REPEATS)
    ]
    return Row(name, min(map(float, runs)), "s", "-", None, 0.3)


def configurations(count: int) -> np.ndarray:
    """Return random states of the arm, shape (count, 3, 3), the bends within 1 rad."""
    rng = np.random.default_rng(1)
    bends = rng.uniform(-1.0, 1.0, (count, 3, 2))
    return np.concatenate([bends, np.broadcast_to(LENGTHS[:, np.newaxis], (count, 3, 1))], axis=-1)


def twists(states: np.ndarray) -> np.ndarray:
    """Return the body twists (..., 3, 6), rotation before translation, of each segment over its length."""
    dx, dy, length = np.moveaxis(states, -1, 0)
    zero = np.zeros_like(dx)
    return np.stack([-dy, dx, zero, zero, zero, length], axis=-1)


def exponentials(state: np.ndarray) -> np.ndarray:
    """Return the tip pose as a product of three general matrix exponentials."""
    return reduce(np.matmul, [expm(matrix) for matrix in generators(state)])


def generators(states: np.ndarray) -> np.ndarray:
    """Return the 4 x 4 generators (..., 3, 4, 4) of the segments."""
    dx, dy, length = np.moveaxis(states, -1, 0)
    matrices = np.zeros((*dx.shape, 4, 4))
    matrices[..., 0, 2], matrices[..., 1, 2], matrices[..., 2, 3] = dx, dy, length
    matrices[..., 2, 0], matrices[..., 2, 1] = -dx, -dy
    return matrices


def all_exponentials(states: np.ndarray) -> np.ndarray:
    """Return many tip poses from one batched call of the general matrix exponential."""
    segments = expm(generators(states))
    return segments[:, 0] @ segments[:, 1] @ segments[:, 2]


def pytransform3d_poses(states: np.ndarray) -> tuple[Computation, Computation] | None:
    """Return one and many tip poses with pytransform3d, or None where it is not installed."""
    try:
        from pytransform3d.trajectories import transforms_from_exponential_coordinates
        from pytransform3d.transformations import transform_from_exponential_coordinates
    except ImportError:
        return None

    def one() -> np.ndarray:
        return reduce(np.matmul, [transform_from_exponential_coordinates(t) for t in twists(states[0])])

    def many() -> np.ndarray:
        segments = transforms_from_exponential_coordinates(twists(states))
        return segments[:, 0] @ segments[:, 1] @ segments[:, 2]

    agree("pytransform3d", one(), chain_transform(states[0]))
    agree("pytransform3d", many(), chain_transform(states))
    return one, many


def soromox_kinematics(states: np.ndarray) -> dict[str, Computation] | None:
    """Return one and many tip poses and Jacobians with soromox, or None where it is not installed."""
    try:
        import jax

        jax.config.update("jax_enable_x64", True)
        import jax.numpy as jnp
        from soromox.systems.components import LinkSpec
        from soromox.systems.pcs import PCS
        from soromox.systems.pcs.structures import PCSStructure
    except ImportError:
        return None

    links = [
        LinkSpec.circular(
            length=length,
            density=1.0,
            radius=0.01,
            reference_strain=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            young_modulus=1.0,
            poisson_ratio=0.45,
        )
        for length in LENGTHS
    ]
    bends_and_stretch = jnp.array([False, True, True, True, False, False] * len(LENGTHS))
    along_x = jnp.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # scalar-last quaternion, position
    arm = PCS.from_links(links, structure=PCSStructure(strain_selector=bends_and_stretch), base_pose=along_x)
    dx, dy, length = np.moveaxis(states, -1, 0)
    strains = jnp.asarray(
        np.stack([-dy / LENGTHS, dx / LENGTHS, length / LENGTHS - 1.0], axis=-1).reshape(len(states), 9)
    )
    strain, tip = strains[0], jnp.asarray(LENGTHS.sum())
    pose = jax.jit(lambda q: arm.forward_kinematics(q, tip))
    jacobian = jax.jit(lambda q: arm.jacobian_inertialframe(q, tip))
    both = jax.jit(lambda q: arm.forward_kinematics_and_jacobian_inertialframe(q, tip))
    poses, jacobians = jax.jit(jax.vmap(pose)), jax.jit(jax.vmap(jacobian))

    rename = np.eye(4)[[1, 2, 0, 3]]
    agree("soromox", rename @ np.asarray(pose(strain)) @ rename.T, chain_transform(states[0]))
    agree("soromox", rename @ np.asarray(poses(strains)) @ rename.T, chain_transform(states))
    return {
        "pose": lambda: pose(strain).block_until_ready(),
        "both": lambda: jax.block_until_ready(both(strain)),
        "poses": lambda: poses(strains).block_until_ready(),
        "jacobians": lambda: jacobians(strains).block_until_ready(),
    }


def agree(peer: str, theirs: np.ndarray, ours: np.ndarray) -> None:
    """Refuse a comparison in which the two sides do not compute the same thing."""
    gap = float(np.abs(np.asarray(theirs) - ours).max())
    if not gap < 1e-12:
        raise ValueError(f"{peer} computes something else: the poses differ by {gap:.3g}")
