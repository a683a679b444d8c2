"""The block `processing` of a project: what is computed and how.

Defaults are those of the settings beside the mathematics; none is repeated.
"""

from typing import Annotated

from photostrip.formats.text.findings import suggestion
from photostrip.formats.text.numbers import shown
from photostrip.network.problem import ASKED, SCREENINGS, TESTS
from photostrip.pipeline.inputs import ADJUSTMENTS, Settings
from photostrip.project.schema.cameras import AUTO, SelfCalibration
from photostrip.project.schema.sections import (
    After,
    Before,
    Flag,
    Fraction,
    Id,
    NotNegative,
    Number,
    NumberOrAuto,
    Positive,
    PositiveOrAuto,
    Range,
    Section,
    bounded,
    choice,
    if_empty,
    key,
    quoted,
    rule,
    wrong,
)
from photostrip.strip.model_links import METHODS as LINK_METHODS
from photostrip.strip.polynomial import DEGREES
from photostrip.strip.relative_orientation.orientation import SCREENINGS as RELATIVE_SCREENINGS
from photostrip.strip.scale_transfer import INTERSECTIONS, SCALE_TRANSFERS

DEFAULTS = Settings()


class Relative(Section):
    """Relative orientation and its search for gross errors."""

    screening: Annotated[str, choice(RELATIVE_SCREENINGS)] = key(
        f"How gross errors are searched for: {quoted(RELATIVE_SCREENINGS)}", DEFAULTS.relative.screening
    )
    grubbs_alpha: Fraction = key(
        "Probability of rejecting a good point of a pair without gross errors", DEFAULTS.relative.grubbs_alpha
    )
    parallax_limit: PositiveOrAuto = key(
        "y parallax that needs no rejection; `auto`: four times its standard deviation",
        DEFAULTS.relative.parallax_limit,
        unit="mm",
    )
    keep: list[Id] = key("Measurements, `photo/point`, that are used whatever the tests say", [])
    drop: list[Id] = key("Measurements, `photo/point`, that are left out", [])


class Links(Section):
    """Links of independent models and their search for gross errors."""

    screening: Annotated[str, choice(LINK_METHODS)] = key(
        "How gross errors are searched for: `auto` (points of each link one after the other) or `none`",
        DEFAULTS.links.screening,
    )
    alpha: Fraction = key(
        "Probability of rejecting anything in the links of a strip without gross errors", DEFAULTS.links.alpha
    )
    keep: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are used whatever the test says", [])
    drop: list[Id] = key("Coordinates, `model/point` or `model/photo`, that are left out", [])


class Polynomial(Section):
    """Polynomial adjustment of a strip."""

    degree: Annotated[str, choice(DEGREES)] = key(
        "`auto` (decided by evidence, which is printed), `1`, `2` or `3`", DEFAULTS.polynomial.degree
    )


class Interior(Section):
    """Interior orientation by fiducial marks."""

    transform: Annotated[str, choice(("auto", "conformal", "affine", "bilinear", "projective"))] = key(
        "`auto` (affine from four marks on, else conformal), `conformal`, `affine`, `bilinear` or `projective`",
        DEFAULTS.interior.transform,
    )
    residuals: Annotated[str, choice(("ignore", "interpolate"))] = key(
        "What the residuals of the marks do: `ignore`, or `interpolate` them to the points",
        DEFAULTS.interior.residuals,
    )


class Bundle(Section):
    """Bundle adjustment of all strips together."""

    screening: Annotated[str, choice(SCREENINGS)] = key(
        "How gross errors are searched for: `snooping` (one after the other), `robust` (re-weighted first) or `none`",
        DEFAULTS.bundle.screening,
    )
    test: Annotated[str, choice(TESTS)] = key(
        "`tau`: residuals against the sigma0 found; `baarda`: against the stated standard deviations",
        DEFAULTS.bundle.test,
    )
    level: Fraction = key(
        "Probability of rejecting anything in an adjustment without gross errors; of many rejections the part that is "
        "false",
        DEFAULTS.bundle.level,
    )
    alpha: Fraction | None = key(
        "Probability of rejecting one good observation; by default `level` is shared out among all tests", None
    )
    power: Fraction = key("Probability with which the minimal detectable errors are found", DEFAULTS.bundle.power)
    variance_components: Flag = key(
        "Estimate the standard deviations of image coordinates, control and camera positions",
        DEFAULTS.bundle.variance_components,
    )
    gone = {"self_calibration": "write `processing.self_calibration`"}  # noqa: RUF012 (a class variable of Section)
    calibration_sigma: Annotated[dict[str, Positive], Before(if_empty)] = key(
        "A-priori standard deviations of these parameters, by name; free without one",
        {},
        unit="mm, mm^-2 for k1 and so on; 1 for affinity and shear",
    )

    @rule
    def _known_parameters(self) -> None:
        for name in self.calibration_sigma:
            if name not in ASKED:
                message = f"`{shown(name)}` is no parameter of a camera"
                expected, fix = f"one of {', '.join(ASKED)}", suggestion(name, ASKED)
                raise wrong(message, code="word", at="calibration_sigma", expected=expected, fix=fix)


Latitude = Annotated[Number, After(bounded(Range(-90.0, 90.0, "deg")))]


class Processing(Section):
    """What is computed and how."""

    gone = {"covariance": "remove it: `adjustment: bundle` took its place, and needs none of it"}  # noqa: RUF012 (as above)

    adjustment: Annotated[str, choice(ADJUSTMENTS)] = key(
        "`auto` (`bundle` wherever it is determined, the polynomials printed beside it; otherwise `polynomial`), "
        "`polynomial` (the strip method), `similarity` (without a polynomial) or `bundle` (all photos rigorously)",
        DEFAULTS.adjustment,
    )
    polynomial: Polynomial = key("Polynomial adjustment", Polynomial())
    self_calibration: SelfCalibration = key(
        "`auto`: lens distortion, principal point and principal distance of a camera are estimated where the "
        "measurements contradict what is given; `never`; or a list of parameters that are estimated: "
        f"{quoted(ASKED)}",
        AUTO,
    )
    bundle: Bundle = key("Bundle adjustment", Bundle())
    relative: Relative = key("Relative orientation", Relative())
    links: Links = key("Links of independent models", Links())
    scale_transfer: Annotated[str, choice(SCALE_TRANSFERS)] = key(
        "`least_squares`: all common points with their precision; `distances`: the textbook's mean of ratios",
        DEFAULTS.formation.scale_transfer,
    )
    scale_weights: Annotated[dict[str, NotNegative], Before(if_empty)] = key(
        "Weights of points in the scale transfer, by name, 1 for all others; with 0 a point joins models only where no"
        " other does",
        {},
    )
    intersection: Annotated[str, choice(INTERSECTIONS)] = key(
        "`mean`: Y of a model point is the mean of both rays; `left`: the point lies on the left ray, as printed",
        DEFAULTS.formation.intersection,
    )
    control_weights: Annotated[str, choice(("stated", "equal"))] = key(
        "`stated`: control weighs by its standard deviations and those of the strip's points; `equal`: each coordinate"
        " alike, as printed",
        DEFAULTS.absolute.control_weights,
    )
    earth_curvature: Annotated[str, choice(("auto", "model", "image", "none"))] = key(
        "`auto` or `none`: the frames carry it, `local` is truly Cartesian; `model`: D^2/2R, for plane map"
        " coordinates of an unknown projection given as `local`; `image`: the same, photo by photo in the image",
        DEFAULTS.absolute.earth_curvature,
    )
    earth_radius: Positive = key(
        "Radius of the Earth for `earth_curvature: model` and `image`", DEFAULTS.absolute.earth_radius, unit="m"
    )
    earth_latitude: Latitude | None = key(
        "Latitude of the strip: the radius of the ellipsoid there takes the place of `earth_radius`", None, unit="deg"
    )
    earth_azimuth: Number | None = key(
        "Azimuth of the strip: the radius in this direction; without it the mean radius at the latitude",
        None,
        unit="deg",
    )
    precision: Flag = key("Compute standard deviations and covariances of points and photos", DEFAULTS.precision)
    cross_validation: Flag = key(
        "Adjust again without each point of the control, or each of ten groups of it, and compare there",
        DEFAULTS.cross_validation,
    )
    principal_point: Flag = key(
        "Reduce image coordinates to the principal point of the camera", DEFAULTS.refinement.principal_point
    )
    distortion: Flag = key("Take out the lens distortion of the camera", DEFAULTS.refinement.distortion)
    refraction: Flag = key("Correct for atmospheric refraction", DEFAULTS.refinement.refraction)
    flying_height: NumberOrAuto = key(
        "Mean height of the cameras above sea level, for refraction and curvature; `auto`: derived",
        DEFAULTS.refinement.flying_height,
        unit="m",
    )
    ground_height: NumberOrAuto = key(
        "Mean height of the ground above sea level, for refraction and curvature; `auto`: derived",
        DEFAULTS.refinement.ground_height,
        unit="m",
    )
    interior: Interior = key("Interior orientation", Interior())

    @rule
    def _azimuth_of_a_place(self) -> None:
        if self.earth_azimuth is not None and self.earth_latitude is None:
            message = "a direction has a radius of curvature at a latitude only"
            raise wrong(message, code="missing-key", at="earth_azimuth", fix="give `earth_latitude` as well")
