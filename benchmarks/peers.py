"""The same bundle adjustment by other programs: Ceres through pyceres, and COLMAP through pycolmap.

Both get the same rays, control and start, one thread, and their own cost functions in C++. The unit of image
coordinates is one sigma, so that Ceres has nothing to scale. COLMAP's camera looks along +z with y down.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    import pyceres  # type: ignore[import-not-found]
    import pycolmap
    from numpy.typing import NDArray

    from photostrip.network.problem import BundleProblem

    Floats = NDArray[np.float64]

FLIP = np.diag([1.0, -1.0, -1.0])  # our photo axes to theirs
MODEL = "SIMPLE_PINHOLE"
RADIUS = 1e12  # of the first trust region
TOLERANCE = 1e-10  # relative change of the sum of squares at which Ceres stops; with 1e-6 up to 2e-3 sigma are left
KEPT: list[object] = []  # objects that two libraries own together: freeing them ends the process


@dataclass(frozen=True, eq=False)
class Peer:
    """What another program found, and how long it took.

    Parameters
    ----------
    building, solving, whole : float
        Seconds of the processor for building its problem from the arrays, for its solver, and for everything including
        the way back.
    points : ndarray, shape (q, 3)
        Adjusted points, metres.
    centers : ndarray, shape (m, 3)
        Adjusted perspective centres, metres.
    steps : int
        Steps of its solver.
    """

    building: float
    solving: float
    whole: float
    points: Floats
    centers: Floats
    steps: int


def available() -> bool:
    """Say whether pyceres and pycolmap are installed."""
    try:
        import pyceres  # noqa: F401
        import pycolmap.cost_functions  # noqa: F401
    except ImportError:
        return False
    return True


def poses_of(problem: BundleProblem) -> Floats:
    """Poses as COLMAP counts them: quaternion x, y, z, w and shift, world to camera, shape (m, 7)."""
    from scipy.spatial.transform import Rotation

    turn = np.swapaxes(problem.start.rotations @ FLIP, 1, 2)
    shift = -np.einsum("nij,nj->ni", turn, problem.start.centers)
    return np.concatenate([Rotation.from_matrix(turn).as_quat(), shift], axis=1)


def centers_of(poses: Floats) -> Floats:
    """Perspective centres of poses, shape (m, 3)."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(poses[:, :4]).as_matrix()
    found: Floats = -np.einsum("nji,nj->ni", turn, poses[:, 4:])
    return found


def _image(problem: BundleProblem) -> tuple[Floats, float]:
    """Image coordinates and principal distance in units of sigma, y down."""
    sigma = problem.images.sigma
    if np.ptp(sigma) > 0.0 or np.ptp(problem.cameras.focal) > 0.0:
        raise ValueError("one sigma and one camera for all rays, please")
    return problem.images.xy / sigma * [1.0, -1.0], float(problem.cameras.focal[0] / sigma[0, 0])


def _control(problem: BundleProblem) -> zip[tuple[int, Floats, Floats]]:
    """Point, position and covariance of each control point."""
    control = problem.control
    covariance = np.einsum("nai,na,naj->nij", control.axes, control.sigma**2, control.axes)
    return zip(control.point.tolist(), control.xyz[:, :, None], covariance, strict=True)


@cache
def pose_manifold() -> pyceres.Manifold:
    """Make the manifold of poses: pyceres has none for quaternion and shift in one block, but COLMAP lends its own."""
    import pycolmap

    scene = _scene(1.0)
    for n in (1, 2):
        image = pycolmap.Image(name=str(n), keypoints=np.zeros((1, 2)), camera_id=1, image_id=n)
        scene.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    track = pycolmap.Track([pycolmap.TrackElement(1, 0), pycolmap.TrackElement(2, 0)])
    scene.add_point3D(np.array([0.0, 0.0, 1.0]), track)
    adjuster = _adjuster(scene, [1, 2])
    pose = scene.frames[1].rig_from_world
    if pose is None:
        raise ValueError("a photo without a pose")
    manifold = adjuster.problem.get_manifold(pose.params)
    KEPT.extend((scene, adjuster, manifold))
    return manifold


def by_ceres(problem: BundleProblem, linear_solver: str = "SPARSE_SCHUR", tolerance: float = TOLERANCE) -> Peer:
    """Adjust with Ceres through pyceres.

    Parameters
    ----------
    problem : BundleProblem
        Rays of one camera with one sigma, and control that is given in all coordinates.
    linear_solver : str
        Name of its linear solver.
    tolerance : float
        Where it stops: relative change of the sum of squares; of the parameters a hundredth of it.

    Returns
    -------
    Peer
        What it found.
    """
    import pyceres
    import pycolmap
    from pycolmap.cost_functions import ReprojErrorCost

    manifold = pose_manifold()
    began = time.process_time()
    xy, focal = _image(problem)
    poses, points = poses_of(problem), problem.start.points.copy()
    camera = np.array([focal, 0.0, 0.0])
    network, loss, model = pyceres.Problem(), pyceres.TrivialLoss(), getattr(pycolmap.CameraModelId, MODEL)
    add, pose, point = network.add_residual_block, list(poses), list(points)
    for i, j, measured in zip(problem.images.photo.tolist(), problem.images.point.tolist(), xy, strict=True):
        add(ReprojErrorCost(model, measured), loss, [point[j], pose[i], camera])
    for j, given, covariance in _control(problem):
        add(pyceres.factors.NormalPrior(given, covariance), loss, [point[j]])
    network.set_parameter_block_constant(camera)
    for block in pose:
        network.set_manifold(block, manifold)
    built = time.process_time()
    options, summary = pyceres.SolverOptions(), pyceres.SolverSummary()
    options.linear_solver_type = getattr(pyceres.LinearSolverType, linear_solver)
    options.logging_type = pyceres.LoggingType.SILENT
    options.num_threads = 1
    options.initial_trust_region_radius = RADIUS
    options.function_tolerance = tolerance
    options.parameter_tolerance = options.gradient_tolerance = 0.01 * tolerance
    pyceres.solve(options, network, summary)
    solved = time.process_time()
    centers = centers_of(poses)
    ended = time.process_time()
    KEPT.append(network)
    return Peer(built - began, solved - built, ended - began, points, centers, summary.num_successful_steps)


def by_colmap(problem: BundleProblem) -> Peer:
    """Adjust with COLMAP's bundle adjustment through pycolmap, its own choice of a linear solver, one thread.

    Parameters
    ----------
    problem : BundleProblem
        As for ``by_ceres``.

    Returns
    -------
    Peer
        What it found. The control is added to COLMAP's Ceres problem.
    """
    import pyceres
    import pycolmap

    began = time.process_time()
    xy, focal = _image(problem)
    scene = _scene(focal)
    photo, point = problem.images.photo, problem.images.point
    order = np.argsort(photo, kind="stable")
    edges = np.searchsorted(photo[order], np.arange(problem.photos + 1))
    place = np.empty(len(photo), np.intp)
    place[order] = np.arange(len(photo)) - edges[photo[order]]
    for n, pose in enumerate(poses_of(problem)):
        rows = order[edges[n] : edges[n + 1]]
        image = pycolmap.Image(name=str(n), keypoints=xy[rows], camera_id=1, image_id=n + 1)
        turn = pycolmap.Rotation3d(pose[:4])
        scene.add_image_with_trivial_frame(image, pycolmap.Rigid3d(turn, pose[4:]))
    by_point = np.argsort(point, kind="stable")
    first = np.searchsorted(point[by_point], np.arange(problem.points + 1))
    elements = list(zip((photo[by_point] + 1).tolist(), place[by_point].tolist(), strict=True))
    for n, xyz in enumerate(problem.start.points):
        track = [pycolmap.TrackElement(i, k) for i, k in elements[first[n] : first[n + 1]]]
        scene.add_point3D(xyz, pycolmap.Track(track))
    adjuster = _adjuster(scene, range(1, problem.photos + 1))
    network, loss, points = adjuster.problem, pyceres.TrivialLoss(), scene.points3D
    for j, given, covariance in _control(problem):
        prior = pyceres.factors.NormalPrior(given, covariance)
        network.add_residual_block(prior, loss, [points[j + 1].xyz])
    built = time.process_time()
    summary = adjuster.solve()
    KEPT.append(adjuster)
    solved = time.process_time()
    found = np.array([scene.points3D[n + 1].xyz for n in range(problem.points)])
    centers = np.array([scene.images[n + 1].projection_center() for n in range(problem.photos)])
    ended = time.process_time()
    steps = getattr(getattr(summary, "ceres_summary", summary), "num_successful_steps", 0)
    return Peer(built - began, solved - built, ended - began, found, centers, steps)


def _scene(focal: float) -> pycolmap.Reconstruction:
    """Make a scene with its camera."""
    import pycolmap

    scene = pycolmap.Reconstruction()
    camera = pycolmap.Camera(model=MODEL, width=1, height=1, params=[focal, 0.0, 0.0], camera_id=1)
    scene.add_camera_with_trivial_rig(camera)
    return scene


def _adjuster(scene: pycolmap.Reconstruction, images: Iterable[int]) -> pycolmap.CeresBundleAdjuster:
    """Make COLMAP's adjuster: photos and points free, camera fixed, no gauge but the control, one thread."""
    import pycolmap

    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    options.print_summary = False
    options.ceres.solver_options.num_threads = 1
    config = pycolmap.BundleAdjustmentConfig()
    for number in images:
        config.add_image(number)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.UNSPECIFIED)
    return pycolmap.create_default_ceres_bundle_adjuster(options, config, scene)
