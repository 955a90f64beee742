"""Pictures to keep: as High, with half the noise and voxels half as large."""

import bpy

rebound = bpy.context.scene.rebound

rebound.samples = 256
rebound.viewport_samples = 128
rebound.shadow_resolution = 4096
rebound.viewport_shadow_resolution = 4096
rebound.soft_shadows = "SAMPLED"
rebound.viewport_soft_shadows = "SAMPLED"
rebound.vpl_scale = "FULL"
rebound.viewport_vpl_scale = "FULL"
rebound.vpl_resolution = 512
rebound.viewport_vpl_resolution = 512
rebound.vpl_pool = 32768
rebound.viewport_vpl_pool = 16384
rebound.vpl_candidates = 16
rebound.viewport_vpl_candidates = 16
rebound.vpl_bounces = "MANY"
rebound.viewport_vpl_bounces = "MANY"
rebound.vpl_cache_rows = 64
rebound.viewport_vpl_cache_rows = 16
rebound.vpl_voxels = 1024
rebound.viewport_vpl_voxels = 512
rebound.viewport_vpl_maps_at_once = 64
rebound.rsm_resolution = 512
rebound.viewport_rsm_resolution = 256
rebound.rsm_gathers = 256
rebound.viewport_rsm_gathers = 128
rebound.rsm_interpolation = "OFF"
rebound.viewport_rsm_interpolation = "OFF"
