"""One strip from its measurements to adjusted points and oriented photos, of photos or of independent models.

What comes in are ideal image coordinates (``photos``) or model coordinates (``models``), what goes out is a
``results.StripResult``. ``finding`` finds strips among photos in no order, ``method`` forms all strips and corrects
their deformation ([001] eq. 150-152); ``absolute`` lays a formed strip on its control ([001] eq. 142-149);
``models`` and it take wrong control out. ``notes`` say what stands beside the numbers.
"""
