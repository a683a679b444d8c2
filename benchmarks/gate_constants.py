"""What each constant of the plausibility gate is good for: what is found, and told of sound projects, with others.

Planted mistakes of ``plausibility.py``, strips and bundles in turn, and sound projects of all layouts of
``false_alarms.py`` are adjusted once; then the gate examines them with every number at the head of its modules doubled
and halved, one at a time. A probability near one gets twice or half of what it leaves to one; whole numbers stay whole.
Printed are the mistakes that are missed then or found besides, and the sound projects of which something is told.

Usage: python benchmarks/gate_constants.py [OF EACH KIND] [--first-seed N] [--only WORD ...] [--of WORD ...]
"""

from __future__ import annotations

import argparse
import ast
import inspect
import os
import pkgutil
import sys
from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported

import numpy as np  # noqa: E402

from benchmarks import false_alarms, plausibility  # noqa: E402
from benchmarks.ablation import put, scaled  # noqa: E402
from benchmarks.false_alarms import Sound  # noqa: E402
from photostrip import plausibility as tests  # noqa: E402
from photostrip.errors import PhotostripError  # noqa: E402
from photostrip.pipeline import plausibility as around_tests  # noqa: E402
from photostrip.pipeline.plausibility import gate  # noqa: E402
from photostrip.pipeline.run import triangulate  # noqa: E402
from photostrip.simulation import Image, Spec  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from photostrip.notes import Finding
    from photostrip.pipeline.inputs import Inputs, Settings

# what things are, not where a limit lies: numbers of unknowns, axes, units, guards against a division by nothing
FACTS = {"CIRCLE_DEG", "DEGREES", "EARTH_RADIUS", "FOOT", "GONS", "HEIGHT", "INCH", "MILLION", "PLAN_UNKNOWNS", "TINY"}
IN_THE_RUN = "shared_by_control"  # tests that a run makes itself: with them it is adjusted again
SOUND = "sound: "


@dataclass(frozen=True)
class Project:
    """A project with what its run asks the gate."""

    name: str
    mistake: plausibility.Mistake | None
    ids: frozenset[str]  # what must be named
    allowed: frozenset[str]  # what may be told of a sound project
    inputs: Inputs
    settings: Settings
    after: Callable[[], tuple[Finding, ...]]  # examines the data with the run, as it came out

    def passes(self, *, again: bool) -> tuple[bool, bool]:
        """Whether `check` and `run` tell what they must, or nothing.

        again: adjust once more.
        """
        after = run(self.inputs, self.settings).findings if again else self.after()
        try:
            before = gate.of_inputs(self.inputs, self.settings)
        except PhotostripError:
            before = ()
        return self._passes(before), self._passes(after)

    def _passes(self, findings: Sequence[Finding]) -> bool:
        named = plausibility.by_code(findings)
        if self.mistake is None:
            return not set(named) - self.allowed
        return plausibility.is_found(named, self.mistake, self.ids)


@dataclass(frozen=True)
class Run:
    """How a run ended for the gate."""

    findings: tuple[Finding, ...]


def run(inputs: Inputs, settings: Settings) -> Run:
    """Adjust a project, which may fail."""
    try:
        return Run(triangulate(inputs, settings).findings)
    except PhotostripError as error:
        return Run(error.findings)


def adjusted(inputs: Inputs, settings: Settings) -> Callable[[], tuple[Finding, ...]]:
    """Adjust a project and keep what the gate is asked afterwards."""
    asked: list[Callable[[], tuple[Finding, ...]]] = []

    def keep(examine: Callable[..., tuple[Finding, ...]], *given: Any) -> tuple[Finding, ...]:  # noqa: ANN401
        asked.append(partial(examine, *given))
        return ()

    with (
        patch.object(gate, "of_result", partial(keep, gate.of_result)),
        patch.object(gate, "of_failure", partial(keep, gate.of_failure)),
    ):
        run(inputs, settings)
    return asked[0]


def planted(first: int, count: int, words: Sequence[str]) -> Iterator[Project]:
    """Plant each mistake in some strips, every second of which is adjusted in a bundle."""
    for mistake in plausibility.MISTAKES:
        if not any(word in mistake.name for word in words):
            continue
        done, seed = 0, first
        while done < count and seed < first + 40 * count:
            seed += 1
            case = mistake.make(seed)
            made = mistake.plant(case)
            if made is None:
                continue
            inputs, ids = made
            settings = mistake.settings(case)
            settings = replace(settings, adjustment="bundle") if done % 2 else settings
            yield Project(mistake.name, mistake, ids, frozenset(), inputs, settings, adjusted(inputs, settings))
            done += 1


def computed(seed: int) -> Sound:
    """Make strips whose image coordinates have no noise."""
    rng = np.random.default_rng([25, seed])

    def draw(rng: np.random.Generator) -> Spec:
        return replace(false_alarms.base_spec(rng, int(rng.integers(5, 15))), image=Image(sigma_um=0.0))

    return false_alarms.sound_of(false_alarms.made(rng, seed, draw), str(rng.choice(false_alarms.METHODS)))


def one_check_point(seed: int) -> Sound:
    """Leave one check point."""
    made = false_alarms.short(seed)
    check = made.inputs.control.check
    control = made.inputs.control.take(~check | (np.cumsum(check) == 1))
    return replace(made, inputs=replace(made.inputs, control=control))


def two_ids(seed: int) -> Sound:
    """Give a control point a second id, in control and photos: P302, but no copied row."""
    case = plausibility.sound(seed)
    o, control = case.inputs.observations, case.inputs.control
    row = int(case.rng.choice(np.flatnonzero(plausibility.shown(case))))
    of_one = o.point == o.point_ids.index(control.ids[row])
    rays = np.r_[np.arange(len(o.xy)), np.flatnonzero(of_one)]
    point = np.where(np.arange(len(rays)) < len(o.xy), o.point[rays], len(o.point_ids))
    again = np.flatnonzero(point == len(o.point_ids))
    xy = o.xy[rays]
    xy[again] += case.rng.normal(0.0, case.spec.image.sigma_um / 1000.0, (len(again), 2))
    observations = replace(
        o, point_ids=(*o.point_ids, "twin"), photo=o.photo[rays], point=point, xy=xy, sigma=o.sigma[rays]
    )
    given = replace(control.take(np.r_[np.arange(len(control.ids)), row]), ids=(*control.ids, "twin"))
    inputs = replace(case.inputs, observations=observations, control=given)
    return Sound(inputs, case.settings, case.spec, frozenset({"P302"}))


RARE = {"computed coordinates": computed, "one check point": one_check_point, "one point under two ids": two_ids}


def sound(first: int, count: int, words: Sequence[str]) -> Iterator[Project]:
    """Make sound projects of all layouts, and rare ones for which there are limits."""
    for name, make in (false_alarms.LAYOUTS | RARE).items():
        for seed in range(first, first + count) if any(word in SOUND + name for word in words) else ():
            made = make(seed)
            after = adjusted(made.inputs, made.settings)
            yield Project(SOUND + name, None, frozenset(), made.allowed, made.inputs, made.settings, after)


def constants() -> Iterator[tuple[str, str, Any]]:
    """Numbers, and tuples of numbers, at the head of the gate's modules: module, name, value."""
    for package in (tests, around_tests):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            for node in ast.parse(inspect.getsource(import_module(found.name))).body:
                targets = [each for part in getattr(node, "targets", ()) for each in ast.walk(part)]
                for name in [each.id for each in targets if isinstance(each, ast.Name) and each.id not in FACTS]:
                    value = pkgutil.resolve_name(f"{found.name}:{name}")
                    parts = value if isinstance(value, tuple) else (value,)
                    if all(isinstance(each, int | float) for each in parts):
                        yield found.name, name, value


def changes() -> dict[str, Callable[[], None]]:
    """Everything that is changed, one after the other."""
    found: dict[str, Callable[[], None]] = {}
    for module, name, value in constants():
        for place in range(len(value)) if isinstance(value, tuple) else (None,):
            for factor in (2.0, 0.5):
                before = value if place is None else value[place]
                after = scaled(before, factor)
                other = after if place is None else (*value[:place], after, *value[place + 1 :])
                if after != before:
                    title = f"{module.rpartition('.')[2]}.{name} {before:g} -> {after:g}"
                    found[title] = partial(put, module, name, other)
    return found


def put_to(text: str) -> None:
    """Give a constant a value: ``plan_fit.PLAN_REFITS=0``."""
    what, _, value = text.partition("=")
    for module, name, before in constants():
        if f"{module.rpartition('.')[2]}.{name}" == what:
            put(module, name, type(before)(float(value)))
            return
    raise SystemExit(f"no constant {what}")


def outcomes(title: str, projects: Sequence[Project]) -> list[tuple[bool, bool]] | str:
    """Examine all projects with a changed gate, or say how it fails; nothing is put back."""
    if "=" in title:
        put_to(title)
    elif title:
        changes()[title]()
    try:
        return [each.passes(again=IN_THE_RUN in title) for each in projects]
    except Exception as error:  # noqa: BLE001  a changed constant may do anything
        return f"{type(error).__name__}: {error}"


PROJECTS: list[Project] = []  # made before processes are forked, which find them here


def changed(title: str) -> list[tuple[bool, bool]] | str:
    """Give the outcomes with one change."""
    return outcomes(title, PROJECTS)


def told(before: Sequence[tuple[bool, bool]], after: Sequence[tuple[bool, bool]]) -> str:
    """Say what passes no longer, and what passes now."""
    lost: Counter[str] = Counter()
    for project, one, other in zip(PROJECTS, before, after, strict=True):
        for command, passed, passes in zip(("check", "run"), one, other, strict=True):
            if passed != passes:
                lost[f"{'+' if passes else '-'} {project.name} ({command})"] += 1
    return "; ".join(f"{what} {count}" if count > 1 else what for what, count in sorted(lost.items(), reverse=True))


def main() -> None:
    """Print one line for every change that makes a difference, and the names of the others."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=1, help="projects of each kind (default 1)")
    parser.add_argument("--first-seed", type=int, default=600_000)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    parser.add_argument(
        "--only", nargs="+", default=("",), metavar="WORD", help="changes whose title has a word, or NAME=VALUE"
    )
    parser.add_argument("--of", nargs="+", default=("",), metavar="WORD", help="mistakes and layouts that have a word")
    options = parser.parse_args()
    PROJECTS.extend(each for make in (planted, sound) for each in make(options.first_seed, options.count, options.of))
    before = outcomes("", PROJECTS)
    if isinstance(before, str):
        raise SystemExit(before)
    of = Counter(not each.name.startswith(SOUND) for each in PROJECTS)
    found = sum(run for (_, run), each in zip(before, PROJECTS, strict=True) if each.mistake)
    print(f"{of[True]} mistakes, {found} found by run; {of[False]} sound projects", flush=True)
    words = [word for word in options.only if "=" not in word]
    titles = [title for title in changes() if any(word in title for word in words)]
    titles += [word for word in options.only if "=" in word]
    same = []
    with get_context("fork").Pool(options.workers, maxtasksperchild=1) as pool:
        for title, after in zip(titles, pool.imap(changed, titles, chunksize=1), strict=True):
            difference = after if isinstance(after, str) else told(before, after)
            if difference:
                print(f"{title:<52} {difference}", flush=True)
            else:
                same.append(title)
    print(f"no difference: {'; '.join(same)}")


if __name__ == "__main__":
    main()
