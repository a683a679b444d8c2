"""How a table is written, as far as the project says it before it is checked."""

from __future__ import annotations

from photostrip.formats.text.numbers import NotANumber
from photostrip.formats.text.numbers import number as read_number
from photostrip.formats.text.table_reader import WORDS
from photostrip.formats.text.table_text import Form
from photostrip.project.yaml.tree import Node

SEPARATORS = {word: sign for sign, word in WORDS.items()}
DECIMALS = {"point": ".", "comma": ","}


def form_of(node: Node | None) -> Form:
    """Read the form of a table at its block of the project; what is no word of the schema counts as not said."""
    if node is None:
        return Form()
    try:
        skipped = int(read_number(node.word("skip") or "0"))
    except NotANumber:
        skipped = 0
    return Form(
        separator=SEPARATORS.get(node.word("separator"), ","),
        decimal=DECIMALS.get(node.word("decimal"), "."),
        skipped=max(skipped, 0),
        columns={name: each.text for name, each in node.mapping_at("columns").items() if each.text},
    )
