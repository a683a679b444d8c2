"""The accuracy report, rendered from the document of a result and from nothing else.

- ``document``: from the document to sections of sentences, facts and tables;
- ``layout``: sections on a page of a given width;
- ``text``: plain text and Markdown;
- ``console``: a terminal, with colours.
"""

from photostrip.report.sections.document import chosen_sections, require_complete, sections_of, title_of

__all__ = ["chosen_sections", "require_complete", "sections_of", "title_of"]
