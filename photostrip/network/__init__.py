"""Every rigorous adjustment: one sparse least-squares problem of rays, control, positions and attitudes.

In comes a ``problem``, out come a ``solution`` and its ``cofactors``: ``solve`` leads from the one to the other over
the ``normal_equations`` of the ``parameters``, whose photos stand in a ``band``. ``rays``, ``calibration`` and
``given_orientations`` linearise what is observed; ``datum`` says where a free network is, ``defects`` what nothing
determines; ``selection`` takes observations out and back, ``robust`` weighs rays, ``gross_errors`` searches.
``hypotheses`` are the table of what may be wrong beside single observations;
``reliability``, ``variance_components``, ``self_calibration`` and ``correlations`` say how good everything is. Arrays
in, arrays out: frames, ids and files are the business of the pipeline.

Source: [Granshaw 1980]; step control after [Marquardt 1963].
"""
