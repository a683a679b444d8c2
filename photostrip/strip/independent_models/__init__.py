"""A strip of independent models: neighbouring models linked by similarities, one behind the other.

In come the model coordinates of a strip (``StripModels``), out comes the formed strip with its links and their tests
(``FormedModels``), which takes the place of a strip formed from photos. ``linking`` solves all links
and takes gross errors out, ``formation`` chains them, the start of their network.

Source: [001] eq. 145-149; docs/independent-models.md.
"""
