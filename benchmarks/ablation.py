"""What each part of the search for gross errors is good for: strips adjusted by programs that differ in one thing.

The strips of ``gross_errors.py``, 20 photos each, are adjusted as the program is, without one of its steps, and with
every constant of ``photostrip/strip/gross_errors`` doubled and halved, one at a time. A probability near one
gets twice or half of what it leaves to one; whole numbers stay whole. Errors are divided by those of the unchanged
program without gross errors.

Usage: python benchmarks/ablation.py [STRIPS] [--first-seed N] [--workers N] [--only WORD ...]
       [--wrong-control]
"""

from __future__ import annotations

import argparse
import ast
import inspect
import os
import pkgutil
import sys
from functools import partial
from importlib import import_module
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run from anywhere, installed or not

from photostrip.threads import limit_threads

limit_threads()  # as the command does, before numpy is imported


from benchmarks.gross_errors import AUTO, CLEAN, HEAD, KNOWN, Run, Tally, loses_anything, much_wrong_run, runs_of  # noqa: E402
from photostrip import frozen  # noqa: E402
from photostrip.network.settings import BundleSettings  # noqa: E402
from photostrip.pipeline.strips.absolute import ScreenedStrip  # noqa: E402
from photostrip.strip import gross_errors as search  # noqa: E402
from photostrip.strip.gross_errors.control.control_screening import not_screened  # noqa: E402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from multiprocessing.pool import Pool

NEAR_ONE = 0.9  # constants between it and 1 are probabilities


def constants() -> Iterator[tuple[str, str, float]]:
    """Numbers at module level in the search for gross errors, and the level in a bundle: module, name, value."""
    yield f"{BundleSettings.__module__}:{BundleSettings.__name__}", "level", BundleSettings.level
    for found in pkgutil.walk_packages(search.__path__, f"{search.__name__}."):
        for node in ast.parse(inspect.getsource(import_module(found.name))).body:
            for name in [each.id for each in getattr(node, "targets", ()) if isinstance(each, ast.Name)]:
                value = pkgutil.resolve_name(f"{found.name}:{name}")
                if isinstance(value, int | float):
                    yield found.name, name, value


def functions(holder: object) -> Iterator[FunctionType]:
    """Functions of a module, and methods of its classes and those that dataclasses make."""
    for each in vars(holder).values():
        found = getattr(each, "__func__", each)
        if isinstance(found, FunctionType):
            yield found
        elif isinstance(found, type) and found.__module__ == getattr(holder, "__name__", ""):
            yield from functions(found)


def put(home: str, name: str, value: object) -> None:
    """Replace what a module or a class (``module:class``) holds, also where it is imported or a default."""
    holder = pkgutil.resolve_name(home)
    before = getattr(holder, name)
    setattr(holder, name, value)
    if name in (fields := getattr(holder, "__dataclass_fields__", {})):  # its class keeps defaults to itself
        fields[name].default = value
        frozen._values_left_out.cache_clear()  # noqa: SLF001
    holders = [holder]
    for module in [each for key, each in sys.modules.items() if key.startswith("photostrip")]:
        named = hasattr(module, name) and imported(module, home, name)
        if named:
            setattr(module, name, value)
        if named or getattr(module, home.rpartition(".")[2], None) is holder:
            holders.append(module)
    for function in [each for some in holders for each in functions(some)]:
        defaults, by_name = function.__defaults__ or (), function.__kwdefaults__ or {}
        function.__defaults__ = tuple(value if each is before else each for each in defaults)
        function.__kwdefaults__ = {key: value if each is before else each for key, each in by_name.items()}


def imported(module: ModuleType, home: str, name: str) -> bool:
    """Whether a module imports a name from its home."""
    nodes = ast.walk(ast.parse(inspect.getsource(module)))
    imports = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.module == home]
    return any(each.name == name for node in imports for each in node.names)


def scaled(value: float, factor: float) -> float:
    """Change a constant; of a probability near one what is left to one."""
    if NEAR_ONE < value < 1:
        return 1 - (1 - value) * factor
    return max(1, int(value * factor + 0.5)) if isinstance(value, int) else value * factor


def without_rays() -> None:
    """Find nothing along the strip."""
    put(f"{search.__name__}.rays.strip_network", "wrong_rays", lambda *_: None)


def without_control() -> None:
    """Believe all control."""

    def believed(oriented: Any, _: object) -> object:  # noqa: ANN401 (a strip of photos or models)
        return ScreenedStrip(oriented, not_screened(oriented.control))

    put("photostrip.pipeline.strips.absolute", "reject_wrong_control", believed)


def without_readmission() -> None:
    """Take nothing back."""
    home = "photostrip.pipeline.strips.screened_formation"
    uses = pkgutil.resolve_name(f"{home}:_uses")
    put(home, "_uses", lambda *given, **_: uses(*given, readmit=False))
    put(f"{search.__name__}.rays.snooping:_Search", "fitting", lambda *_: None)
    put(f"{search.__name__}.control.control_deletion:JointAdjustment", "shrunk", lambda _, out: out)


def without_exchange() -> None:
    """Leave the suspects among much wrong control as variance components find them."""
    put(f"{search.__name__}.control.control_deletion:JointAdjustment", "exchanged", lambda _, out: out)


def changes() -> dict[str, Callable[[], None]]:
    """Everything that is changed, one after the other."""
    found: dict[str, Callable[[], None]] = {
        "as it is": lambda: None,
        "without the step along the strip": without_rays,
        "without the step at the control": without_control,
        "without re-admission": without_readmission,
        "without exchanging suspects": without_exchange,
    }
    for (module, name, value), factor in product(constants(), (2.0, 0.5)):
        other = scaled(value, factor)
        if other != value:
            title = f"{module.rpartition('.')[2]}.{name} {value:g} -> {other:g}"
            found[title] = partial(put, module, name, other)
    return found


def changed(title: str, seeds: range) -> list[dict[str, Run]] | str:
    """Adjust strips by a changed program, or say how it fails. Nothing is put back: the process ends afterwards."""
    changes()[title]()
    try:
        return [runs_of("strips", seed, (CLEAN, AUTO))[1] for seed in seeds]
    except Exception as error:  # noqa: BLE001  a changed constant may do anything
        return f"{type(error).__name__}: {error}"


def print_ablation(pool: Pool, seeds: range, words: Sequence[str]) -> None:
    """Print what the strips are like without parts of the search, and with other constants."""
    titles = [title for title in changes() if any(word in title for word in words or ("",))]
    base = pool.map(partial(runs_of, "strips", wanted=(CLEAN, KNOWN)), seeds)
    print(HEAD, flush=True)
    for title, found in zip(titles, pool.imap(partial(changed, seeds=seeds), titles), strict=True):
        if isinstance(found, str):
            print(f"{title:44s}{found}", flush=True)
            continue
        tally, changed_clean = Tally(), 0
        for (project, known), runs in zip(base, found, strict=True):
            tally.add(project, known | {name: run for name, run in runs.items() if name == AUTO})
            changed_clean += CLEAN not in runs or loses_anything(project, runs[CLEAN])
        tally.counts["touched"] = changed_clean
        failed = sum(AUTO not in runs for runs in found)
        print(tally.row(title), f" {failed} failed" if failed else "", flush=True)


def changed_control(title: str, seeds: range) -> int:
    """Count strips with two fifths of the control wrong in which a changed program names just that."""
    changes()[title]()
    return sum(wrong == named and not others for wrong, named, others, _ in map(much_wrong_run, seeds))


def print_control(pool: Pool, seeds: range, words: Sequence[str]) -> None:
    """Print how often just the wrong control is named where much of it is."""
    titles = [title for title in changes() if any(word in title for word in words or ("",))]
    for title, right in zip(titles, pool.imap(partial(changed_control, seeds=seeds), titles), strict=True):
        print(f"{title:44s}{right:4d} of {len(seeds)}", flush=True)


def main() -> None:
    """Print one line for every change."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("strips", type=int, nargs="?", default=30, help="strips for every change (default 30)")
    parser.add_argument("--first-seed", type=int, default=1, help="number of the first strip (default 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one for each core)")
    parser.add_argument(
        "--only", nargs="+", default=(), metavar="WORD", help="changes whose title has one of the words"
    )
    parser.add_argument("--wrong-control", action="store_true", help="strips with two fifths of the control wrong")
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.strips)
    with get_context("fork").Pool(options.workers, maxtasksperchild=1) as pool:
        (print_control if options.wrong_control else print_ablation)(pool, seeds, options.only)


if __name__ == "__main__":
    main()
