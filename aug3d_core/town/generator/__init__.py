"""Build the town: its plan, terrain, streets, buildings and textures.

town      the whole town as two textured meshes: the ground, and all that stands on it
plan      what a plan consists of
planning  plan a town
terrain   how the flat plan is bent into the world
model     triangles with texture, collected piece by piece
atlas     many small pictures in one texture
blocks    what stands in a block
estates   blocks that make reconstruction hard
streets   where streets run, and how they are painted and lined
buildings, facades, roofs   buildings, their walls and their roofs
trees, cars, lake   what else there is
painted_ground  the ground as one picture
swatches  patches of material that many objects share
noise     grain for textures
season    the colours of a season
"""
