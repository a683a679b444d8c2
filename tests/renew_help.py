"""Write the help texts that tests/cli/test_help.py compares with (``python -m tests.renew_help``); review the diff."""

from __future__ import annotations

import argparse

from tests.cli.helps import FOLDER, helps, shown


def main() -> None:
    argparse.ArgumentParser(prog="python -m tests.renew_help", description=__doc__).parse_args()
    FOLDER.mkdir(exist_ok=True)
    for name, arguments in helps().items():
        (FOLDER / f"{name}.txt").write_text(shown(arguments), encoding="utf-8")


if __name__ == "__main__":
    main()
