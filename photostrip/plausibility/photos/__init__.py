"""Mistakes in the photos and their points.

``units`` the size of image coordinates, ``mosaic`` photos laid out side by side by their common points,
``flight_order`` what that says about the order, ``identity`` ids of points, ``shared_ids`` those of two points,
``tied_strips`` the same between strips, ``flight`` the perspective centres of a formed strip,
``rotations`` the reading of given angles. All but ``units`` look at what is common to neighbours, so that neither the
principal distance nor the control matters.
"""
