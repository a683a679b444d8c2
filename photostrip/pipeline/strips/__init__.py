"""One strip from its measurements to adjusted points and oriented photos, of photos or of independent models.

What comes in are ideal image coordinates (``photos``) or model coordinates (``models``), what goes out is a
``results.StripResult``. Both kinds share one skeleton: ``absolute`` lays the formed strip on its control ([001] eq.
142-149) and takes wrong control out, ``adjusting`` corrects what is left ([001] eq. 150-152). Before, ``forming`` forms
strips of photos, ``screened_formation`` without what their rays contradict; ``stages`` keeps what is asked for again;
``notes`` and ``model_notes`` say what stands beside the numbers.
"""
