"""The operations of strip triangulation, in the order of the method.

``image_coordinates`` measured to ideal image coordinates; ``relative_orientation`` of each pair; ``strip_formation`` of
its models; ``absolute_orientation`` on the control; ``polynomial`` correction of the deformation; ``resection`` of the
photos. Beside them ``error_propagation``, ``bundle``, ``gross_errors``,
``independent_models`` and ``plausibility``; ``robust`` has the weights that several of them use.
"""
