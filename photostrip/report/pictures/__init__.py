"""Pictures of a document: the same document gives the same bytes.

- ``ground`` and ``result`` draw a result with the elements of ``svg`` and the axes of ``chart``, for the page of its
  report and as files;
- ``batch_map`` draws where the projects of a batch lie, likewise;
- ``plans``, ``plan_strip`` and ``terrestrial`` draw files of their own with matplotlib, through ``drawing``;
- ``style`` has the colours, marks and sizes of both. docs/design.md says why there are two ways.
"""
