//! Memory layout of a program without an operating system.

fn main() {
    println!("cargo:rerun-if-changed=boot");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        let folder = std::env::var("CARGO_MANIFEST_DIR").expect("set by cargo");
        let arch = std::env::var("CARGO_CFG_TARGET_ARCH").expect("set by cargo");
        println!("cargo:rustc-link-arg=-T{folder}/boot/{arch}.ld");
    }
}
