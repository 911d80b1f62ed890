// Residuals of the SoftRas mode, one workgroup a tile.

#import prehend::goal::goal_at
#import prehend::residuals::{store_pixel_sums, store_tile_sums}
#import prehend::softras::seen_in_softras_mode

@compute @workgroup_size(8, 8)
fn softras_residuals(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
) {
    let pixel = seen_in_softras_mode(group.z, lane, group.xy, id.xy);
    store_pixel_sums(lane, pixel, goal_at(id.xy));
    store_tile_sums(group.z, lane, group.xy);
}
