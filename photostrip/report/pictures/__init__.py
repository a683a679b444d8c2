"""Pictures of a document as SVG: the same document gives the same bytes.

``svg`` has the elements, ``chart`` panels and maps with their layers, ``places`` brings a result to metres on the plan;
the other modules draw a subject each: ``result`` calls those of a result.
"""
