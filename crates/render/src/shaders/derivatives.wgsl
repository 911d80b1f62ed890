// Whether a pass computes derivatives.
#define_import_path prehend::derivatives

// Where it is false the compiler drops their computation.
@id(0) override DERIVATIVES: bool = true;

// A function, since imports cannot name an `override`.
fn with_derivatives() -> bool {
    return DERIVATIVES;
}
