"""Blocks about adjustments: strips, pairs, junctions, links, what was rejected, and bundle.

Each module turns the stages of a ``StripResult`` or of the bundle into records of its blocks: millimetres of the image
become micrometres, radians degrees, and discrepancies are carried to the ground by the similarity of the strip.
``classical`` says what polynomials leave beside a bundle, ``deformation`` estimates twist and bending of single models
([003] eq. 10.12).
"""
