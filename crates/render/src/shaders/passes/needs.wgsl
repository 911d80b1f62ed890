// Notes what the work buffers would have needed for a picture, which is not added up.

#import prehend::results::note_needs

@compute @workgroup_size(1)
fn needs(@builtin(workgroup_id) group: vec3<u32>) {
    note_needs(group.z);
}
