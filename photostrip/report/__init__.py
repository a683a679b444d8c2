"""The accuracy report, rendered from the document of a result and from nothing else.

- :mod:`photostrip.report.document`: from the document to sections of sentences, facts and tables;
- :mod:`photostrip.report.layout`: sections on a page of a given width;
- :mod:`photostrip.report.text`: plain text and Markdown;
- :mod:`photostrip.report.console`: a terminal, with colours.
"""

from photostrip.report.document import chosen_sections, require_complete, sections_of, title_of

__all__ = ["chosen_sections", "require_complete", "sections_of", "title_of"]
