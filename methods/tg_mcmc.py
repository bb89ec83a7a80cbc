"""TG-MCMC: geodesic Langevin dynamics on unit quaternions, cooled down to the most probable rotations."""

import time
from dataclasses import dataclass

import numpy as np

from bench import Checkpoint, Estimate, Floats, Problem, method, parameter, so3

from ._lib.graph.confidence import confidence, strengths
from ._lib.loops import geodesic_kernels
from ._lib.starts import SEEDED, Start, Started, start_rotations

CHORDAL = 8.0  # squared Frobenius distance of two rotations over the sine squared of half their angle


@method("tg-mcmc", title="TG-MCMC", cite="birdal2018", requires=("scipy", "numba"), uses=("weights", "precisions"))
@dataclass(frozen=True)
class TGMCMC(Started):
    """Minimises sum_ij w_ij sin(angle(R_i^T R_ij R_j) / 2)^2, the negative log-likelihood of Bingham noise, by cooling.

    A camera is a unit quaternion q_i with a velocity v_i tangent to the sphere. With the potential
    U = sum_ij w_ij (1 - <q_ij, q_i conj(q_j)>^2), w being the `confidence` of the edges, and inverse temperature beta,
    the dynamics dq = v dt, dv = -grad U dt - c v dt + sqrt(2 c / beta) dW have exp(-beta U) as the density of q.
    A step is

    1. v <- e^(-c h) v: friction.
    2. v <- v - h grad U + noise, projected onto the tangent space.
    3. q and v move along the great circle for the time h.

    The temperature falls along half a cosine from `noise_deg` to zero within `cooling` steps. What follows is
    Riemannian gradient descent with momentum, the limit beta -> infinity, until the root mean square step is below
    the tolerance.

    Source: Birdal, Simsekli, Eken and Ilic, NeurIPS 2018 (the model with rotations only, the splitting, the tempering).
    Deviations: there are no translations and no prior; the Bingham distribution of an edge has one concentration for
    its three axes; it samples no posterior, so that there is no uncertainty of the rotations;
    each camera has the sum of its w as its mass, so that one step suits all; the variance of the noise is
    (1 - e^(-2 c h)) / beta over the mass, exact for friction alone; the schedule is ours.

    The cost is a sum of squares: with equal concentrations the method is as sensitive to outliers as `shonan` with
    ``loss=l2``, whose optimum it shares. `Estimate.cost` is eight times the potential, the squared chordal distances.

    Parameters
    ----------
    init
        Where to start, see `start_rotations`.
    noise_deg
        Standard deviation of a measurement about an axis at the first temperature: beta = 2 / noise^2. Zero leaves out
        all noise.
    step
        h. Explicit steps are stable below 1, but above (pi (1 - keep) / 2)^(1/2) two cameras that turn against each
        other by a full turn in every step can go on for ever.
    keep
        e^(-c h), the share of the velocity that a step leaves: at least 0, below 1.
    cooling
        Steps with noise.
    iterations
        All steps, at most.
    tolerance_deg
        Root mean square rotation of a camera in one step, below which the descent ends.
    checkpoint_every
        Iterations between two checkpoints.
    """

    init: Start = "spanning-tree"
    noise_deg: float = parameter(20.0, at_least=0)
    step: float = parameter(0.39, above=0, below=1)
    keep: float = parameter(0.9, at_least=0, below=1)
    cooling: int = parameter(500, at_least=0)
    iterations: int = parameter(10_000, at_least=1)
    tolerance_deg: float = parameter(1e-6, above=0)
    checkpoint_every: int = parameter(100, at_least=1)

    @property
    def deterministic(self) -> bool:
        """Only without noise, and from a start that is."""
        return 0 in (self.noise_deg, self.cooling) and self.init not in SEEDED

    @property
    def exact_to_deg(self) -> float | None:
        """From a random start a ring can wind around once too often; no promise is made."""
        return None if self.init == "random" else 1e-4

    def solve(self, problem: Problem, rng: np.random.Generator) -> Estimate:  # noqa: D102
        clock = time.perf_counter()
        measured = so3.to_quaternion(problem.rotations)
        cameras = so3.to_quaternion(start_rotations(self.init, problem, rng))
        weights, masses = confidence(problem), strengths(problem)
        velocities, forces, kicks = np.zeros((3, problem.n, 4))
        energy, tolerance = np.empty(1), np.radians(self.tolerance_deg)
        checkpoints = list[Checkpoint]()
        converged, t = False, 0
        while t < self.iterations and not converged:
            geodesic_kernels.bingham_forces(problem.edges, measured, weights, cameras, forces, energy)
            if t % self.checkpoint_every == 0:
                checkpoints.append(_checkpoint(t, clock, cameras, energy[0]))
            temperature = self._temperature(t)
            kicks[:] = 0
            if temperature > 0:
                deviations = np.sqrt((1 - self.keep**2) * temperature / masses)
                kicks[:] = deviations[:, None] * rng.standard_normal((problem.n, 4))
            geodesic_kernels.geodesic_step(cameras, velocities, forces, masses, kicks, self.keep, self.step)
            t += 1
            rotated = 2 * self.step * np.sqrt(np.sum(velocities**2) / problem.n)
            converged = temperature == 0 and rotated < tolerance
        geodesic_kernels.bingham_forces(problem.edges, measured, weights, cameras, forces, energy)
        checkpoints.append(_checkpoint(t, clock, cameras, energy[0]))
        return Estimate(
            checkpoints[-1].rotations,
            iterations=t,
            stop_reason=f"root mean square step below {self.tolerance_deg:g} degrees"
            if converged
            else "iteration limit",
            cost=float(CHORDAL * energy[0]),
            checkpoints=tuple(checkpoints),
            notes=() if converged else (f"not converged: cameras still turned by {np.degrees(rotated):.1e} degrees",),
        )

    def _temperature(self, t: int) -> float:
        """1 / beta at iteration t."""
        progress = min(t / self.cooling, 1.0) if self.cooling else 1.0
        return float(np.radians(self.noise_deg) ** 2 / 2 * (0.5 + 0.5 * np.cos(np.pi * progress)))


def _checkpoint(iteration: int, clock: float, cameras: Floats, energy: float) -> Checkpoint:
    """The state of the quaternions `cameras` (n, 4)."""
    rotations = so3.from_quaternion(cameras)
    return Checkpoint(iteration, time.perf_counter() - clock, rotations, {"cost": float(CHORDAL * energy)})
