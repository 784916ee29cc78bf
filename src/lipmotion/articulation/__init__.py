"""Articulation: what a mouth, and the face around it, does when motion and phones are shown.

This floor alone decides on rest, contact, phone targets, coarticulation, pauses and liveliness. From a motion it makes
one ``SpokenMouth`` (``mouth``) and one ``Liveliness``; faces, meshes and curve sets only draw them.
"""
