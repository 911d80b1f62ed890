// The picture of the contour mode.

#import prehend::band::seen_in_contour_mode
#import prehend::picture::store_picture

@compute @workgroup_size(8, 8)
fn contour_picture(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
    @builtin(global_invocation_id) id: vec3<u32>,
) {
    store_picture(group.z, seen_in_contour_mode(group.z, lane, group.xy, id.xy), id.xy);
}
