"""Errors carried through the strip method: from image coordinates and control to points and photos.

In come the stages of a strip (pairs, formed strip, similarity, polynomials, photos); out come its errors as sparse rows
of derivatives by the image coordinates, and their covariances. ``strip_errors`` differentiates relative orientation,
intersection and the formation of the strip, ``control_errors`` the fit to the control, ``photo_errors`` the resection;
``fitted_strip`` is all of it after the fit. ``image_variance`` scales it; ``strip_at_control`` is what the control is
tested with, ``check_errors`` what check points are; ``weak_pairs`` says which pairs make their points much worse than a
good one.

Source: derived for [001] eq. 126-151; the equations (1) to (7) stand in docs/precision.md.
"""
