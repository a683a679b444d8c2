"""Pictures of a document: the same document gives the same bytes.

- ``strip`` draws a result into the page of its report with the elements of ``svg``, on the ground of ``plan_view``;
- ``plans``, ``plan_strip`` and ``terrestrial`` draw files of their own with matplotlib, through ``drawing``;
- ``style`` has the colours, marks and sizes of both. docs/design.md says why there are two ways.
"""
