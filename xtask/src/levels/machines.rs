//! The machines and what testing on them needs.

/// Debian's `cargo-web`.
pub(super) const CARGO: &str = "/usr/bin/cargo";

/// Debian's `rustc-web`.
pub(super) const RUSTC: &str = "/usr/bin/rustc";

/// The same package's.
pub(super) const RUSTDOC: &str = "/usr/bin/rustdoc";

/// A file, or a program on the path, and Debian's package that has it.
pub(super) struct Need {
    pub(super) file: &'static str,
    pub(super) package: &'static str,
}

/// What every machine needs.
pub(super) const TOOLCHAIN: &[Need] = &[
    Need { file: RUSTC, package: "rustc-web" },
    Need { file: CARGO, package: "cargo-web" },
    Need { file: "/usr/lib/rustlib/src/rust/library/std/Cargo.toml", package: "rust-web-src" },
];

/// Some tests of the library.
pub(super) struct Tests {
    /// As `cargo test` takes it.
    pub(super) target: &'static [&'static str],
    /// As a test program takes it.
    pub(super) filter: &'static [&'static str],
    /// What part of the usual rounds is enough: one in so many.
    pub(super) share: &'static str,
}

/// A kind of processor.
pub(super) struct Machine {
    pub(super) name: &'static str,
    /// The compiler's name.
    pub(super) triple: &'static str,
    pub(super) needs: &'static [Need],
    /// The program that links; without one, Rust's own linker.
    pub(super) linker: Option<&'static str>,
    /// What programs run in.
    pub(super) runner: &'static str,
    /// For the compiler.
    pub(super) flags: &'static str,
    /// For cargo.
    pub(super) options: &'static [&'static str],
    pub(super) tests: &'static [Tests],
}

/// Every machine.
pub(super) const MACHINES: &[Machine] = &[
    Machine {
        name: "NEON (aarch64)",
        triple: "aarch64-unknown-linux-gnu",
        needs: &[
            Need { file: "aarch64-linux-gnu-gcc", package: "gcc-aarch64-linux-gnu" },
            Need { file: "/usr/aarch64-linux-gnu/lib/crt1.o", package: "libc6-dev-arm64-cross" },
            Need { file: "qemu-aarch64", package: "qemu-user" },
        ],
        linker: Some("aarch64-linux-gnu-gcc"),
        runner: "qemu-aarch64 -L /usr/aarch64-linux-gnu",
        flags: "",
        options: &["-Zbuild-std=std,test"],
        tests: &[
            Tests { target: &["--lib"], filter: &["simd::"], share: "1" },
            Tests { target: &["--test=matrix"], filter: &["every_level"], share: "1" },
            Tests { target: &["--test=slices"], filter: &["--skip=long_slices"], share: "20" },
            Tests { target: &["--test=lemma"], filter: &[], share: "10" },
            // With other builders the instructions are the same.
            Tests {
                target: &["--test=watertight"],
                filter: &["--skip=with_every_builder"],
                share: "100",
            },
        ],
    },
    // Debian's C library for it is older than Rust expects, and lacks what joins threads; threads
    // cannot be made there anyway, so calls to what is missing may trap.
    Machine {
        name: "simd128 (WebAssembly)",
        triple: "wasm32-wasip1",
        needs: &[
            Need { file: "node", package: "nodejs" },
            Need { file: "/usr/lib/wasm32-wasi/crt1-command.o", package: "wasi-libc" },
        ],
        linker: None,
        // With threads of its own for compiling, node 20 crashed at its end, once in fifteen runs.
        runner: "node --no-warnings --single-threaded ../../xtask/src/levels/wasi.mjs",
        flags: "-C target-feature=+simd128 -C link-self-contained=no -L native=/usr/lib/wasm32-wasi \
                -C link-arg=/usr/lib/wasm32-wasi/crt1-command.o \
                -C link-arg=--unresolved-symbols=ignore-all",
        options: &["-Zbuild-std=std,panic_abort,test", "--no-default-features"],
        tests: &[
            Tests { target: &["--lib"], filter: &[], share: "1" },
            Tests { target: &["--test=matrix"], filter: &["every_level"], share: "1" },
            Tests { target: &["--test=slices"], filter: &[], share: "1" },
            Tests { target: &["--test=lemma"], filter: &[], share: "1" },
            Tests { target: &["--test=watertight"], filter: &[], share: "1" },
        ],
    },
];
