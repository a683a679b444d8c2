"""Pictures of the ground that a result adjusted: ``plan``, ``footprints``, ``ties``, ``precision_map``, ``terrain``.

``plan_view`` and ``image_plane`` bring the document to metres on the plan and to millimetres in the photo; ``sheet`` is
the ground on a picture.
"""
