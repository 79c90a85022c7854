"""The online estimator: learn the fibre from the camera, then fuse the two (Wang et al., Sec. II)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, numbers
from soro_lib.estimators.extreme_learning_machine import POSE_SIZE, ExtremeLearningMachine
from soro_lib.estimators.grating_mask import GratingMask
from soro_lib.estimators.pose_fusion import fuse_poses, inlier_weighted_error

Array = NDArray[np.float64]


@dataclass(frozen=True)
class VisualStrainSettings:
    """Settings of the online estimator.

    Attributes
    ----------
    initial_samples : int
        Samples N0 of the first solution (paper: 450).
    update_threshold : float
        Reprojection error above which nothing is learned [px] (paper: 1.4).
    lower, upper : float
        Bounds E_L and E_U of the fusion [px] (not printed in the paper).
    nominal_inliers : float
        Feature count below which the reprojection error is raised; 0 takes it as it comes.
    grating_noise : float
        Standard deviation of one shift, for the contact mask [m]; 0 leaves the mask out.
    agreement : float
        Distance of camera and fibre up to which they confirm each other; no grating is doubted then [m].
    """

    initial_samples: int = 450
    update_threshold: float = 1.4
    lower: float = 1.2
    upper: float = 2.4
    nominal_inliers: float = 200.0
    grating_noise: float = 0.0
    agreement: float = 2e-3

    def __post_init__(self) -> None:
        """Check the values; the error names the field and its bound."""
        check_fields(self, "initial_samples", at_least=1)
        check_fields(self, "update_threshold", "nominal_inliers", "grating_noise", "agreement", at_least=0)
        check_fields(self, "upper")
        check_fields(self, "lower", at_least=0, below=self.upper)


@dataclass(frozen=True)
class PoseEstimate:
    """What the estimator knows after one sample; poses are ``(7,)``, metres and scalar-last quaternion.

    Attributes
    ----------
    pose : ndarray (7,)
        Fused pose, always finite, with a unit quaternion.
    camera_pose : ndarray (7,)
        Camera's pose; the latest valid one while the camera is lost.
    fibre_pose : ndarray (7,)
        Fibre's pose, predicted before this sample was learned; not-a-number before the first solution.
    fibre_variance : float
        Variance of each component of the fibre's position [m^2]; infinite before the first solution.
    posterior_error : float
        Distance between label and fibre after learning this sample [m]; not-a-number if it was not learned.
    error : float
        Reprojection error that the fusion acted on [px].
    learned : bool
        Whether this sample was learned.
    masked : int
        Number of gratings that were set aside.
    note : str
        Why something was refused, empty if nothing was.
    """

    pose: Array
    camera_pose: Array
    fibre_pose: Array
    fibre_variance: float = np.inf
    posterior_error: float = np.nan
    error: float = np.inf
    learned: bool = False
    masked: int = 0
    note: str = ""


class VisualStrainEstimator:
    """Learns the fibre online while the camera is good and leans on it where the camera is not.

    Parameters
    ----------
    network : ExtremeLearningMachine
        The network that is trained; not fitted yet.
    settings : VisualStrainSettings
        Thresholds and bounds.

    Notes
    -----
    A time stamp that does not advance, or a sample before the camera gave its first pose, repeats the last
    estimate and says so in the note. Gratings that are not finite are filled in by the contact mask if there
    is one, else the fibre repeats its last pose.
    """

    def __init__(self, network: ExtremeLearningMachine, settings: VisualStrainSettings | None = None) -> None:
        self.network = network
        self.settings = settings or VisualStrainSettings()
        self._shifts: list[Array] = []
        self._labels: list[Array] = []
        self._mask: GratingMask | None = None
        self._time = -np.inf
        self._camera_pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self._fibre_pose = np.full(POSE_SIZE, np.nan)
        self._fused_pose = self._camera_pose

    def update(
        self,
        time: float,
        shift: ArrayLike,
        camera_pose: ArrayLike | None,
        reprojection_error: float,
        inliers: float = np.inf,
    ) -> PoseEstimate:
        """Take one synchronised sample of both sensors.

        Parameters
        ----------
        time : float
            Time stamp [s].
        shift : array_like (l,)
            Wavelength shifts [m].
        camera_pose : array_like (7,) or None
            Pose from the camera [m, -]; None or not finite if the camera is lost.
        reprojection_error : float
            Reprojection error [px].
        inliers : float
            Number of features that support the pose.

        Returns
        -------
        PoseEstimate

        Raises
        ------
        ValueError
            If a shape is wrong.
        """
        shift = numbers("shift", shift, (self.network.centres.shape[1],))
        if not time > self._time:
            return self._estimate(self._fused_pose, note=f"time stamp {time} does not follow {self._time}")
        self._time = time
        error = self._watch_camera(camera_pose, reprojection_error, inliers)
        shift, masked, whole = self._watch_fibre(shift, error)
        learnable = whole and error <= self.settings.update_threshold
        if not self.network.is_fitted:
            return self._collect(shift, error, learnable, masked)
        variance, posterior, note = np.inf, np.nan, ""
        if learnable:
            result = self.network.update(shift, self._camera_pose)
            self._fibre_pose, variance = result.prediction, result.variance
            learnable, note = result.accepted, result.reason
            posterior = float(np.sqrt(result.posterior_error[:3] @ result.posterior_error[:3]))
        elif whole:
            self._fibre_pose, variance = self.network.predict_with_variance(shift)
        pose = fuse_poses(
            self._camera_pose, self._fibre_pose, error, lower=self.settings.lower, upper=self.settings.upper
        )
        return self._estimate(pose, variance, posterior, error, learnable, masked, note)

    def _watch_camera(self, pose: ArrayLike | None, reprojection_error: float, inliers: float) -> float:
        """Keep the latest valid camera pose; return the error the fusion shall act on."""
        if pose is None:
            return np.inf
        pose = numbers("camera_pose", pose, (POSE_SIZE,))
        if not np.isfinite(pose).all() or not np.isfinite(reprojection_error) or pose[3:] @ pose[3:] < 1e-12:
            return np.inf
        self._camera_pose = np.concatenate([pose[:3], pose[3:] / np.sqrt(pose[3:] @ pose[3:])])
        if self.settings.nominal_inliers == 0.0:
            return float(reprojection_error)
        return float(inlier_weighted_error(reprojection_error, inliers, self.settings.nominal_inliers))

    def _watch_fibre(self, shift: Array, error: float) -> tuple[Array, int, bool]:
        """Doubt the gratings unless the camera confirms them; return shifts, number set aside, all finite."""
        whole = bool(np.isfinite(shift).all())
        if self._mask is None:
            return shift, 0, whole
        if whole and error <= self.settings.update_threshold:
            apart = self.network.predict(shift)[:3] - self._camera_pose[:3]
            if apart @ apart < self.settings.agreement**2:
                self._mask.learn(shift)
                return shift, 0, True
        repaired = self._mask.repair(shift)
        return repaired.shift, int(repaired.masked.sum()), not repaired.masked.all()

    def _collect(self, shift: Array, error: float, learnable: bool, masked: int) -> PoseEstimate:
        """Gather the first N0 samples; until then the camera stands alone."""
        if learnable:
            self._shifts.append(shift)
            self._labels.append(self._camera_pose)
        if len(self._shifts) >= self.settings.initial_samples:
            self.network.fit(self._shifts, self._labels)
            if self.settings.grating_noise > 0.0:
                self._mask = GratingMask(self._shifts, noise=self.settings.grating_noise)
        return self._estimate(self._camera_pose, error=error, learned=learnable, masked=masked)

    def _estimate(self, pose: Array, *known: Any, **more: Any) -> PoseEstimate:
        """Return the estimate with this fused pose and the sensors' latest, and remember the pose."""
        self._fused_pose = pose
        return PoseEstimate(pose, self._camera_pose, self._fibre_pose, *known, **more)
