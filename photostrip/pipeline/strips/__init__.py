"""One strip from its measurements to adjusted points and oriented photos, of photos or of independent models.

What comes in are ideal image coordinates (``photos``) or model coordinates (``models``), what goes out is a
``results.StripResult``. ``finding`` finds strips among photos in no order, ``forming`` forms all strips,
``screened_formation`` those of photos without what their rays contradict; ``absolute`` lays a formed strip on its
control ([001] eq. 142-149), ``photos_on_control`` and ``models`` take wrong control out, ``adjusting`` corrects what is
left ([001] eq. 150-152). ``notes`` and ``model_notes`` say what stands beside the numbers.
"""
