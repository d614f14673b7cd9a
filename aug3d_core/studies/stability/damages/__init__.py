"""Damages: each changes a copied folder of a stage in place, by a dose.

photographs  photographs as files, and what their EXIF says
positions    the positions in the photo table
tracks       what structure from motion found
fused        the fused points that meshes are drawn through
placed       what stands where: the unit of the world, domes, photographs of the test
packed       the packed scene
"""
