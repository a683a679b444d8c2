"""The verdict on a result: good, not verified, worth a look, or failed; and what to look at, worst first.

It is made from the finished document, so that a saved result has the same verdict; its limits stand first.

Each question has the same level (``TEST_LEVEL``), which its tests share: a probability here is that of the test times
the number of tests of its question (Bonferroni), so that each is held against the same level. Whether a given point
stands out beside the others is asked where the differences are made (``given.stand_out``).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

from photostrip.errors import EXIT_DONE, EXIT_TOLERANCE
from photostrip.notes import LOST_SAY, Document, before, counted, listed
from photostrip.result.table import Table
from photostrip.statistics import SECOND_LOOK, SLIGHTLY, TEST_LEVEL, chi2_p_value, f_p_value, normal_quantile

LEAST_STATED = 0.005  # micrometres, which the document rounds to nothing

SIGMA0, RESIDUALS, PAIRS = "sigma0", "image residuals", "pairs"
CHECKS, LEFT_OUT = "check points", "control left out in turn"


class Pair(NamedTuple):
    """What a pair's sigma0 says."""

    place: int  # its row in ``models``
    found: float  # sigma0, micrometres
    others: float  # that of the other pairs together, 0 where there is none
    # probabilities, of all pairs together, of so large a sigma0 beside the others, and with what is stated
    among: float
    beside_stated: float


def probabilities(document: Document) -> dict[str, float]:
    """Return the probability by chance of what each test found, those that could be made."""
    seen = {CHECKS: _chance_of_checks(document), LEFT_OUT: document.get("cross_validation", {}).get("p")}
    made = {name: p for name, p in seen.items() if p is not None}
    found = {
        SIGMA0: [2 * _larger(sigma0_ratio(document), document["summary"]["redundancy"])],
        RESIDUALS: [2 * _larger(residuals_ratio(document), 2 * document["counts"]["image_points_used"])],
        PAIRS: [p for pair in pairs(document) for p in (pair.among, pair.beside_stated)],
        **{name: [p * len(made)] for name, p in made.items()},
    }
    return {name: min(1.0, *values) for name, values in found.items() if values}


def stated(document: Document) -> float:
    """Return the stated standard deviation of an image or model coordinate, micrometres."""
    return max(float(document["summary"]["sigma_given_um"]), LEAST_STATED)


def sigma0_ratio(document: Document) -> float:
    """Return sigma0 in units of what is stated, of the bundle, or of the pairs or links."""
    test = document.get("bundle", {}).get("sigma0_test")
    return float(test["sigma0"] if test else (document["summary"]["sigma0_um"] or 0.0) / stated(document))


def residuals_ratio(document: Document) -> float:
    """Return the image residuals under the final orientations, rms, in units of what is stated.

    They have fewer redundant coordinates than there are: chance makes them smaller than this.
    """
    return float((document["summary"]["image_rms_um"] or 0.0) / stated(document))


def _larger(ratio: float, redundancy: int) -> float:
    """Probability of a larger ratio of a standard deviation to the true one by chance."""
    return chi2_p_value(ratio**2 * redundancy, redundancy)


def pairs(document: Document) -> list[Pair]:
    """Return what every pair's sigma0 says, beside the other pairs and beside what is stated."""
    columns = (document["models"].values(key) for key in ("sigma0_um", "redundancy"))
    known = [(k, found, own) for k, (found, own) in enumerate(zip(*columns, strict=True)) if found is not None]
    squares, redundancy = sum(own * found**2 for _, found, own in known), sum(own for _, _, own in known)
    tests, given = 2 * len(known), stated(document)
    pairs = []
    for place, found, own in known:
        left = redundancy - own
        others = (max(squares - own * found**2, 0.0) / left) ** 0.5 if left else 0.0
        among = f_p_value((found / others) ** 2, own, left) if others and own else 1.0
        alone = chi2_p_value((found / given) ** 2 * own, own)
        pairs.append(
            Pair(
                place=place,
                found=found,
                others=others,
                among=min(1.0, among * tests),
                beside_stated=min(1.0, alone * tests),
            )
        )
    return pairs


def _chance_of_checks(document: Document) -> float | None:
    """Return the probability of the check points: of all together, and of their rms in plan and in height."""
    check = document.get("precision", {}).get("check")
    if not check:
        return None
    chances: Sequence[float] = [
        p for p in (*(check[part]["p"] for part in PARTS), *(test["p"] for test in check["tests"])) if p is not None
    ]
    return min(1.0, min(chances) * len(chances)) if chances else None


Tests = Mapping[str, float]  # probabilities by chance
PARTS = ("plan", "height")
VERDICTS = GOOD, UNVERIFIED, LOOK, FAILED = "good", "unverified", "look", "failed"

PAIR_RATIO = 1.5  # of a pair's sigma0, or of image residuals, to that of the others, or to what is stated
PHOTO_RATIO = 3.0  # of a photo's image residuals to those of the project
POOR_CONTROL = 5.0  # rms of the control's residuals in standard deviations; a long strip bends by that much
MANY_REJECTED, MANY_OF_PHOTO = 0.05, 0.2  # share of the points in pairs, of those of a photo
SMALLEST_PROBABILITY = 0.001  # probability that is written as a number
AREAS = {"plan": "ellipse", "height": "interval"}
WRONG_CONTROL = {"control-rejected", "control-doubtful"}  # notes on control points that a finding may have named
BARE_ENDS = {"P501", "P503"}  # findings on control that leaves an end out
NAMED = 3  # pairs, photos, findings or notes of one kind that are told; the given points of the others are named


def verdict_of(document: Document) -> Document:
    """Return status, accuracy in a sentence and what to look at, from a document that has no verdict yet."""
    tests = probabilities(document)
    errors, sigma0 = list(_findings(document, "error")), list(_sigma0(document, tests))
    failed = [*_tolerances(document), *(errors or (sigma0 if _hopeless(document) else ()))]
    lost, others = _warnings(document)
    look_at = [
        *failed,
        *_findings(document, "warning"),
        *_kinds(document, lost, "note"),
        *(
            () if errors else (each for each in _numbers(document, tests) if each not in failed)
        ),  # of data that contradict themselves as a whole they say the same
        *_rejected(document),
        *_kinds(document, others, "note"),
    ]
    verification = _verification(document)
    status = FAILED if failed else LOOK if look_at else GOOD if verification["verified"] else UNVERIFIED
    agreement = "" if errors else _agreement(document, tests)
    return {
        "status": status,
        "accuracy": accuracy(document),
        "agreement": agreement,
        **verification,
        "tests": Table.of("verdict.tests", {"test": list(tests), "p": list(tests.values()), "level": TEST_LEVEL}),
        "look_at": look_at,
    }


def _verification(document: Document) -> Document:
    """Return whether the points are verified in plan and in height, and by what; if not, what would verify them."""
    checks, turned = document["summary"]["check"], document.get("cross_validation", {})
    plan, height = (checks[part]["count"] for part in ("plan", "height"))
    if plan and height:
        return {"verified": True, "verification": f"{counted(plan, 'check point')} in plan and {height} in height"}
    if turned and turned["plan"]["count"] and turned["height"]["count"]:
        points, heights = counted(turned["plan"]["count"], "control point"), turned["height"]["count"]
        return {"verified": True, "verification": f"{points} in plan and {heights} in height, left out in turn"}
    missing = "the heights" if plan else "the plan coordinates" if height else "the result"
    return {"verified": False, "verification": f"no point verifies {missing}: {_cure(document)}"}


def _cure(document: Document) -> str:
    folds = document.get("cross_validation", {}).get("folds")
    if folds:
        reason = next((fold["reason"] for fold in folds if fold["reason"]), "it does not give all coordinates")
        return f"the control left out in turn cannot ({reason}); measure check points"
    if document["counts"]["control_points"]:
        return "hold some given points back as check points (`role: check`), or run with --cross-validate"
    return "measure points whose coordinates are known, and give them with `role: check`"


def _numbers(document: Document, tests: Tests) -> Iterator[str]:
    """Say where differences, residuals and standard deviations do not go together."""
    noted = (each for each in document["notes"] if each["code"] in WRONG_CONTROL)
    named = {point for each in (*_open_findings(document), *noted) for point in each["points"]}
    yield from _control(document)
    yield from _odd(document, "control", named)
    yield from _odd(document, "check", named)
    if not named.issuperset(name for (name,) in _given(document, "check", "id")):
        yield from _checks(document, tests)
    yield from _odd(document, "cross_validation", named)
    yield from _cross_validation(document, tests)
    yield from _sigma0(document, tests)
    yield from _pairs(document, tests)
    yield from _photos(document, tests)


def exit_code(status: str, *, strict: bool) -> int:
    """Exit code of a result: 1 when a tolerance is not kept; with `strict` of every verdict but good."""
    return EXIT_TOLERANCE if status == FAILED or (strict and status != GOOD) else EXIT_DONE


def accuracy(document: Document) -> str:
    """Say in one sentence how good the points are, and from what that is known.

    Check points that stand out are told apart: one wrong given point says nothing about the others.
    """
    scale = "model" if document["summary"].get("model_scale") else "photo"
    at = {"check": "check points, which took no part", "cross_validation": "control points left out in turn"}
    role = seen_at(document)
    sound = {name: headline_rms(document, role, name) for name in PARTS}
    um = {k: f"{v['rms_um']:.1f} µm at {scale} scale, " for k, v in sound.items() if v["rms_um"] is not None}
    parts = [
        f"{part['rms']:.3f} m in {name} ({um.get(name, '')}{counted(part['count'], 'point')})"
        for name, part in sound.items()
        if part["count"]
    ]
    if not parts:
        return "no given point was measured"
    odd = [
        (listed(names), f"{_whole(document, role)[name]['rms']:.3f} m in {name}")
        for name in PARTS
        if (names := standing_out(document, role, name))
    ]
    out = [
        f"{' and '.join(text for _, text in group)} with {names}" for names, group in groupby(odd, key=itemgetter(0))
    ]
    return f"rms {' and '.join(parts)} at {at.get(role, 'control points')}" + (f"; {' and '.join(out)}" if out else "")


def seen_at(document: Document) -> str:
    """Return what says most about the points: ``check``, ``cross_validation`` or ``control``."""
    return next((role for role in ("check", "cross_validation") if any(_counts(document, role))), "control")


def _counts(document: Document, role: str) -> list[int]:
    return [_whole(document, role).get(part, {}).get("count") or 0 for part in PARTS]


def _whole(document: Document, role: str) -> Document:
    return dict(document.get(role, {}) if role == "cross_validation" else document["summary"][role])


def _given(document: Document, role: str, *keys: str) -> Iterator[tuple[Any, ...]]:
    """Give the values of some keys at the points of a role."""
    if role == "cross_validation":
        if role not in document:
            return iter(())
        points = document[role]["points"]
        columns = [[""] * len(points) if key == "rejected" else points.values(key) for key in keys]
    else:
        points = document["control"]
        points = points[points["role"] == role]
        columns = [points.values(key) for key in keys]
    return zip(*columns, strict=True)


def headline_rms(document: Document, role: str, part: str) -> Document:
    """Return count, rms and largest of the differences in plan or height, metres and µm, of what does not stand out."""
    out = set(standing_out(document, role, part))
    if not out:
        return dict(_whole(document, role)[part])
    axes, points = set("xy" if part == "plan" else "z"), _given(document, role, "id", "rejected", part, f"{part}_um")
    kept = [
        (name, *sizes)
        for name, rejected, *sizes in points
        if name not in out and sizes[0] is not None and axes.isdisjoint(rejected or "")
    ]
    names, metres, micrometres = zip(*kept, strict=True)
    largest, worst = max(zip(map(abs, metres), names, strict=True))
    sums = {"rms": _rms(metres), "rms_um": _rms(micrometres), "max": largest, "worst": worst}
    return {"count": len(kept), **sums}


def standing_out(document: Document, role: str, part: str) -> list[str]:
    return [name for name, parts in _given(document, role, "id", "stands_out") if part in parts]


def _rms(values: Sequence[float | None]) -> float | None:
    squares = [value**2 for value in values if value is not None]  # µm are known where a photo scale is
    return float((sum(squares) / len(squares)) ** 0.5) if squares else None


def _tolerances(document: Document) -> Iterator[str]:
    for each in document["tolerances"]:
        unit = each["unit"].replace("um", "µm")
        if each["value"] is None:
            yield f"{each['name']} cannot be tested against {each['limit']:g} {unit}: there is no such point"
        elif not each["passed"]:
            value = f"{each['value']:.{2 if each['unit'] == 'um' else 4}f}"
            yield f"{each['name']} is {value} {unit}, the limit is {each['limit']:g} {unit}"


def _control(document: Document) -> Iterator[str]:
    ratio = document["summary"]["control"]["normalised"]
    if ratio is not None and ratio > POOR_CONTROL:
        yield (
            f"the control points fit {ratio:.1f} times worse than expected from their standard deviations and the "
            "precision of one model: the control is not as good as stated, or the strip is still deformed"
        )


def _odd(document: Document, role: str, named: set[str]) -> Iterator[str]:
    """Name the points that do not go with the others, in plan and in height, and that nothing else has `named`."""
    points = [each for each in _given(document, role, "id", "stands_out", *PARTS) if each[1] and each[0] not in named]
    odd = [(name, parts, dict(zip(PARTS, sizes, strict=True))) for name, parts, *sizes in points]
    if not odd:
        return
    sizes = [
        f"{name} ({', '.join(f'{abs(size[part]):.3f} m in {part}' for part in parts)})" for name, parts, size in odd
    ]
    others = " and ".join(
        f"{headline_rms(document, role, part)['rms']:.3f} m in {part}"
        for part in PARTS
        if any(part in parts for _, parts, _ in odd)
    )
    left_out = ", left out," if role == "cross_validation" else ""
    noun, verb = ("point", "stands") if len(odd) == 1 else ("points", "stand")
    who = f"{'control' if left_out else role} {noun} {listed(sizes)}{left_out} {verb} out"
    yield f"{who}; the others have an rms of {others}"


def _checks(document: Document, tests: Tests) -> Iterator[str]:
    """Say when the check points contradict the standard deviations of the points."""
    check = document.get("precision", {}).get("check")
    if not check:
        ratio = document["summary"]["check"]["normalised"]
        if ratio is not None and ratio > POOR_CONTROL:
            yield f"the check points are {ratio:.1f} times farther off than expected from the precision of one model"
    elif tests.get(CHECKS, 1.0) < _unseen_level(document):
        yield _contradiction("the check points", document, check, "rms", tests[CHECKS])


def _cross_validation(document: Document, tests: Tests) -> Iterator[str]:
    """Say when control that was left out contradicts the standard deviations of the points."""
    if tests.get(LEFT_OUT, 1.0) < _unseen_level(document):
        found = document["cross_validation"]
        yield _contradiction("control points left out in turn", document, found, "ratio", tests[LEFT_OUT])


def _agreement(document: Document, tests: Tests) -> str:
    """Say how far what took no part agrees with the standard deviations, where it does not contradict them."""
    who = {CHECKS: "the check points", LEFT_OUT: "control points left out in turn"}
    said = []
    for name, subject in who.items():
        if (p := tests.get(name)) is not None and p >= _unseen_level(document):
            against = "speak slightly against" if p < SLIGHTLY else "do not contradict"
            said.append(f"{subject} {against} the standard deviations of the points, p = {p:.2g}")
    return "; ".join(said)


def _contradiction(who: str, document: Document, found: Document, ratio: str, chance: float) -> str:
    said = [
        f"in {name} {part[ratio]:.1f} times as large as expected, {part['inside_95']} of {part['count']} inside the "
        f"95 % {AREAS[name]}"
        for name in PARTS
        if (part := found[name])["count"]
    ]
    likely = f"{100 * chance:.1f} %" if chance >= SMALLEST_PROBABILITY else f"below {100 * SMALLEST_PROBABILITY:g} %"
    return (
        f"the differences at {who} contradict the standard deviations of the points: {'; '.join(said)}; probability of "
        f"that by chance {likely}{_known_cause(document)}"
    )


def _unseen_level(document: Document) -> float:
    """Return the level of the test of the check points, and of the control left out in turn.

    Where something larger than the noise is known to be left out, less evidence is enough.
    """
    return SLIGHTLY if _known_cause(document) else TEST_LEVEL


def _known_cause(document: Document) -> str:
    left_out = any(note["code"] == "curvature-left-out" for note in document["notes"])
    return "; the Earth's curvature is left out: try `earth_curvature: model`" if left_out else ""


def _sigma0(document: Document, tests: Tests) -> Iterator[str]:
    summary, ratio = document["summary"], sigma0_ratio(document)
    if tests[SIGMA0] < TEST_LEVEL:
        kind = "model" if summary.get("model_scale") else "image"
        times = f"{ratio:.1f}" if ratio > PAIR_RATIO else f"{ratio:.2f}"
        yield (
            f"the {kind} coordinates are {times} times worse than stated: sigma0 {summary['sigma0_um']:.1f} µm, "
            f"stated {stated(document):.1f} µm"
        )


def _hopeless(document: Document) -> bool:
    """Whether observations are as far off on the average as the largest of so many good ones: nothing holds then."""
    redundancy = document["summary"]["redundancy"]
    largest = normal_quantile(1 - SECOND_LOOK / (2 * max(redundancy, 1)))
    return redundancy > 0 and sigma0_ratio(document) > largest


def _pairs(document: Document, tests: Tests) -> Iterator[str]:
    """Name the pairs that are worse than the others, or than stated, by more than chance; a bundle needs none."""
    if "bundle" in document:
        return
    given = stated(document)
    quiet = tests[SIGMA0] < TEST_LEVEL  # said of the whole project already
    odd = [
        pair
        for pair in pairs(document)
        if (pair.among < TEST_LEVEL and pair.found > PAIR_RATIO * pair.others)
        or (not quiet and pair.beside_stated < TEST_LEVEL and pair.found > PAIR_RATIO * given)
    ]
    odd.sort(key=attrgetter("found"), reverse=True)
    for pair in odd[:NAMED]:
        row, beside = document["models"][pair.place], ""
        if pair.others:
            beside = f", the other pairs have {pair.others:.1f} µm"
        yield (
            f"photos {row['left']} and {row['right']}: sigma0 {pair.found:.1f} µm, stated {given:.1f} µm{beside}; the "
            f"largest y parallax is at point {row['max_parallax_point']}"
        )
    yield from _more(len(odd), "pair")


def _more(number: int, one: str, kind: str = "") -> Iterator[str]:
    if number > NAMED:
        yield f"{counted(number - NAMED, f'more {one}')}{kind}, like the last one"


def _photos(document: Document, tests: Tests) -> Iterator[str]:
    """Weigh all image residuals; name photos of large ones, then those that lost much, as by a shift of all points."""
    whole, given = document["summary"]["image_rms_um"], stated(document)
    ratio = residuals_ratio(document)
    if ratio > PAIR_RATIO and tests[RESIDUALS] < TEST_LEVEL <= tests[SIGMA0]:
        text = f"rms {whole:.1f} µm, stated {given:.1f} µm"
        yield f"the image residuals under the final orientation are {ratio:.1f} times as large as stated: {text}"
    rejected = {(row["photo"], row["point"]) for row in document["rejected"] if not row["readmitted"]}
    lost, poor, losing = Counter(photo for photo, _ in rejected), [], []
    columns = (document["photos"].values(key) for key in ("id", "image_rms_um", "points"))
    for name, known, points in zip(*columns, strict=True):
        rms, out, measured = known or 0, lost[name], lost[name] + points
        if whole and rms > PHOTO_RATIO * whole:
            text = f"image residuals of {rms:.1f} µm under the final orientation, {whole:.1f} µm in the whole project"
            poor.append((rms / whole, f"photo {name}: {text}"))
        elif out > MANY_OF_PHOTO * measured:
            losing.append((out / measured, f"photo {name}: {out} of its {measured} points were rejected"))
    for odd, kind in ((poor, " with large residuals"), (losing, " that lost points")):
        yield from (text for _, text in sorted(odd, reverse=True)[:NAMED])
        yield from _more(len(odd), "photo", kind)


def _rejected(document: Document) -> Iterator[str]:
    used, gone = (int(document["models"][key].sum()) for key in ("points_used", "points_rejected"))
    if gone > MANY_REJECTED * (used + gone):
        yield f"{gone} of {used + gone} points in pairs were rejected, {100 * gone / (used + gone):.0f} %"


def _open_findings(document: Document) -> list[Document]:
    return [each for each in document["findings"] if not each["accepted"]]


def _findings(document: Document, severity: str) -> Iterator[str]:
    """Name what the data say against themselves and nobody has accepted."""
    return _kinds(document, [each for each in _open_findings(document) if each["severity"] == severity], "finding")


def _warnings(document: Document) -> tuple[list[Document], list[Document]]:
    """Return the warnings on what was given and lost its say, and all others; not what a finding says of the same."""
    named = {point for each in _open_findings(document) for point in each["points"]}
    told = [each for each in document["notes"] if each["code"] in WRONG_CONTROL and named.issuperset(each["points"])]
    bare = {strip for each in _open_findings(document) if each["code"] in BARE_ENDS for strip in each["strips"]}
    told += [each for each in document["notes"] if each["code"] == "extrapolation" and each["strip"] in bare]
    open_ones = [each for each in document["notes"] if each["severity"] == "warning" and each not in told]
    lost = [each for code in LOST_SAY for each in open_ones if each["code"] == code]
    return lost, sorted((each for each in open_ones if each["code"] not in LOST_SAY), key=itemgetter("code"))


def _kinds(document: Document, every: Iterable[Document], one: str) -> Iterator[str]:
    """Say the first of each kind of findings or notes, and count the others; what they say of given points is named."""
    rejected = {name: out for role in ("control", "check") for name, out in _given(document, role, "id", "rejected")}
    for code, group in groupby(every, key=itemgetter("code")):
        kind = list(group)
        told, more = [_sentence(each, rejected) for each in kind[:NAMED]], list(_more(len(kind), one))
        concerned = (name for each in kind[NAMED:] for name in each["points"] or each["photos"])
        names = ", ".join(dict.fromkeys(name for name in concerned if name in rejected or code in LOST_SAY))
        yield from [*told[:-1], f"{told[-1]}; {more[0]}: {names}"] if names else [*told, *more]


def _sentence(each: Document, rejected: Document) -> str:
    """Say a note after its place, or a finding after its code and whether the given points it names were used."""
    if "accepted" not in each:
        return before(each["file"], each["line"], each["column"]) + str(each["message"])
    unused = bool(each["points"]) and all(rejected.get(name) for name in each["points"])
    return f"{each['code']} {each['message']}{'; not used' if unused else ''}"
