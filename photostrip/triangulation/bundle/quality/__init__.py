"""How good an adjusted bundle is.

``cofactors`` of all parameters and residuals, single and joint; from these and the residuals
``reliability`` (redundancy numbers, test values, detectable errors), ``variance_components``, ``self_calibration``
(significance of parameters) and ``correlations``. Source: [Baarda 1968], [Pope 1976], [Förstner 1979].
"""
