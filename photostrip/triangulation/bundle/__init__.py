"""Bundle adjustment: all rays of all photos with control and camera positions in one least-squares solution.

``problem`` what is given, ``solution`` what is found, ``solve`` from the one to the other, ``precision`` the
cofactors of everything. Arrays in, arrays out: frames, ids and files are the business of the pipeline.
"""
