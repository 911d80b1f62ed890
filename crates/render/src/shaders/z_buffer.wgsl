// What the hard z-buffer shows.
#define_import_path prehend::z_buffer

// Nearest face and the bits of its 1/Z.
@group(0) @binding(12) var<storage, read_write> visible: array<vec2<u32>>;
