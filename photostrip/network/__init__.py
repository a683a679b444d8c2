"""Every rigorous adjustment: one sparse least-squares problem of rays, control, positions and attitudes.

In comes a ``problem``, out come a solution (``adjustment``) and its cofactors, over the ``normal_equations``, whose
photos stand in a band. ``observations`` linearises what is observed; ``defects`` says where a free network is, and what
nothing determines; ``snooping`` searches for gross errors, ``testing`` says which rays are wrong.
``hypotheses`` are the table of what may be wrong beside single observations; ``reliability`` says how good
everything is. Arrays in, arrays out: frames, ids and files are the business of the pipeline.

Source: [Granshaw 1980]; step control after [Marquardt 1963].
"""
