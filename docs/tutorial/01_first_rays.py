"""
1. A picture
============

The first.
"""

import wavefront as wf

image = wf.render(wf.Sphere((0, 0, 0), 1), spp=4, size=(160, 120), lighting="studio")
image.save("one.png")
