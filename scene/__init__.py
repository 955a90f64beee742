"""Blender's depsgraph in, frozen numpy data out.

``data`` and ``changes`` know nothing of Blender. ``convert`` is the entry; ``meshes``, ``lights``, ``materials``,
``images`` and ``cameras`` each read one kind of data-block. Nothing here writes to Blender's data.
"""
