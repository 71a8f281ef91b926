//! The arrows of `docs/architecture.md`: a folder of `src` imports from earlier ones only, and within a folder no
//! files or folders import each other in a circle.

mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use source::{Import, Source};

/// The folders and files of `src`, each after all that it may import from; those of one line know nothing of each other.
const LAYERS: &[&[&str]] = &[
    &["error"],
    &["control", "memory"],
    &["linalg"],
    &["grid"],
    &["terrain"],
    &["surface"],
    &["synthetic", "metric"],
    &["eikonal"],
    &["route", "region"],
    &["export"],
    &["render"],
    &["plan"],
    &["serve", "cli"],
    &["lib"],
];

#[test]
fn folders_import_from_earlier_ones_only() {
    let house = House::open();
    let mut offenders = String::new();
    for import in &house.imports {
        let [from, to] = [import.from, import.to].map(|module| house.place(module)[0].clone());
        if from != to && layer(&from) <= layer(&to) {
            writeln!(offenders, "{from} → {to}: {}", house.describe(import)).unwrap();
        }
    }
    assert!(
        offenders.is_empty(),
        "a folder imports from one that is not before it:\n{offenders}\
         Move the thing to the earliest folder that can own it, or pass it in (LAYERS in {}).",
        file!()
    );
}

#[test]
fn files_of_a_folder_do_not_import_each_other_in_a_circle() {
    let circles = House::open().circles();
    assert!(
        circles.is_empty(),
        "these import each other in a circle:\n{circles}\
         Move what both need to a file of its own, which neither owns."
    );
}

#[test]
fn things_are_imported_from_the_folder_that_owns_them() {
    let house = House::open();
    let mut offenders = String::new();
    for import in &house.imports {
        let folder = import.path.strip_prefix("crate::").and_then(|path| path.split("::").next());
        let from = &house.place(import.from)[0];
        if from != "cli" && from != "lib" && folder.is_some_and(|f| !LAYERS.concat().contains(&f)) {
            writeln!(offenders, "{}", house.describe(import)).unwrap();
        }
    }
    assert!(offenders.is_empty(), "imported through the root of the crate:\n{offenders}");
}

fn layer(name: &str) -> usize {
    LAYERS
        .iter()
        .position(|names| names.contains(&name))
        .unwrap_or_else(|| panic!("src/{name} has no place in LAYERS of {}", file!()))
}

/// Modules, imports between them, and where they lie in the tree of folders.
struct House {
    source: Source,
    imports: Vec<Import>,
}

impl House {
    fn open() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let house = Self::read(&["src/lib.rs", "src/cli/main.rs"], &|file| {
            std::fs::read_to_string(root.join(file)).ok()
        });
        assert!(house.imports.len() > 500, "imports are no longer seen");
        house
    }

    fn read(roots: &[&str], read: &dyn Fn(&Path) -> Option<String>) -> Self {
        let mut source = Source::default();
        for (name, root) in ["ridgeway", "command"].into_iter().zip(roots) {
            source.add(name, Path::new(root), read);
        }
        let imports = source.imports();
        Self { source, imports }
    }

    /// Folders below `src`, then the file, without extension.
    fn place(&self, module: usize) -> Vec<String> {
        let file = &self.source.modules[module].file;
        let names = file.strip_prefix("src").unwrap().with_extension("");
        names.iter().map(|name| name.to_string_lossy().into_owned()).collect()
    }

    fn describe(&self, import: &Import) -> String {
        let [from, to] = [import.from, import.to].map(|i| self.source.modules[i].file.display());
        format!("{from}:{} imports {} of {to}", import.line, import.path)
    }

    /// The circles, with the imports that make them. A `mod.rs` is in none: it shows what its files own, and owns what
    /// they share.
    fn circles(&self) -> String {
        // By folder, which of its files and folders imports which, and by what.
        let mut folders = BTreeMap::<PathBuf, BTreeMap<[String; 2], &Import>>::new();
        for import in &self.imports {
            let [from, to] = [import.from, import.to].map(|module| self.place(module));
            let common = from.iter().zip(&to).take_while(|(from, to)| from == to).count();
            if common == 0 || from == to {
                continue; // Between folders of `src`, or within a file.
            }
            let arrow = [from[common].clone(), to[common].clone()];
            if !arrow.iter().any(|name| name == "mod") {
                let folder = from[..common].iter().collect();
                folders.entry(folder).or_default().entry(arrow).or_insert(import);
            }
        }
        let mut circles = String::new();
        for (folder, arrows) in folders {
            for ([from, to], import) in &arrows {
                if reachable(to, &arrows).contains(from) {
                    let folder = folder.display();
                    let line = self.describe(import);
                    writeln!(circles, "{folder}: {from} → {to}: {line}").unwrap();
                }
            }
        }
        circles
    }
}

/// Where arrows lead from here.
fn reachable<'a>(
    from: &'a String,
    arrows: &'a BTreeMap<[String; 2], &Import>,
) -> BTreeSet<&'a String> {
    let mut seen = BTreeSet::new();
    let mut open = vec![from];
    while let Some(at) = open.pop() {
        if seen.insert(at) {
            open.extend(arrows.keys().filter(|[from, _]| from == at).map(|[_, to]| to));
        }
    }
    seen
}

/// The imports of a made-up crate of files, as `file:line path → owner`.
fn imports(files: &[(&str, &str)]) -> Vec<String> {
    let files: BTreeMap<_, _> =
        files.iter().map(|(file, text)| (Path::new(*file), *text)).collect();
    let house = House::read(&["src/lib.rs"], &|file| files.get(file).map(ToString::to_string));
    let describe = |import: &Import| {
        let [from, to] = [import.from, import.to].map(|module| house.place(module).join("/"));
        format!("{from}:{} {} → {to}", import.line, import.path)
    };
    house.imports.iter().map(describe).collect()
}

#[test]
fn imports_are_seen_in_use_and_in_code() {
    let a = "use crate::b::{Thing, deep::{self, Other as Another}};\n\
             fn f() -> crate::b::Thing { vec![deep::g(), super::c::h()] }";
    let found = imports(&[
        ("src/lib.rs", "mod a; mod b; mod c;"),
        ("src/a.rs", a),
        ("src/b/mod.rs", "pub mod deep; pub struct Thing;"),
        ("src/b/deep.rs", "pub fn g() {} pub struct Other;"),
        ("src/c.rs", "pub fn h() {}"),
    ]);
    assert_eq!(
        found,
        [
            "a:1 crate::b::Thing → b/mod",
            "a:2 crate::b::Thing → b/mod",
            "a:1 crate::b::deep → b/deep",
            "a:1 crate::b::deep::Other → b/deep",
            "a:2 deep::g → b/deep",
            "a:2 super::c::h → c",
        ]
    );
}

#[test]
fn re_exports_lead_to_the_owner() {
    let found = imports(&[
        ("src/lib.rs", "mod a; mod b; pub use b::{Thing, Used}; fn f(_: Used) {}"),
        ("src/a.rs", "use crate::Thing;"),
        ("src/b/mod.rs", "mod deep; pub use self::deep::{Thing, Used};"),
        ("src/b/deep.rs", "pub struct Thing; pub struct Used;"),
    ]);
    assert_eq!(found, ["lib:1 b::Used → b/deep", "a:1 crate::Thing → b/deep"]);
}

#[test]
fn tests_comments_and_visibility_import_nothing() {
    let a = "//! [`crate::b::Thing`]\n\
             // use crate::b::Thing;\n\
             #[cfg(test)] use crate::b::Thing;\n\
             pub(in crate::b) const TEXT: &str = \"crate::b::Thing\";\n\
             #[cfg(test)] mod tests { use crate::b::Thing; }";
    let found = imports(&[
        ("src/lib.rs", "mod a; mod b;"),
        ("src/a.rs", a),
        ("src/b.rs", "pub struct Thing; #[cfg(test)] mod tests;"),
    ]);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn every_dependency_is_listed_with_its_reason() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |file: &str| std::fs::read_to_string(root.join(file)).unwrap();
    let manifest = read("Cargo.toml");
    let list = read("docs/dependencies.md");
    let tables = manifest.split("\n[").filter(|table| table.contains("dependencies]\n"));
    let crates: Vec<_> = tables
        .flat_map(|table| table.lines().filter_map(|line| line.split_once(" = ")))
        .map(|(name, _)| name)
        .collect();
    let missing: Vec<_> =
        crates.iter().filter(|name| !list.contains(&format!("`{name}`"))).collect();
    assert!(crates.len() > 20 && missing.is_empty(), "not in docs/dependencies.md: {missing:?}");
}

#[test]
fn the_map_names_files_that_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let map = std::fs::read_to_string(root.join("docs/architecture.md")).unwrap();
    let modules = House::open().source.modules;
    let exists = |name: &&str| {
        root.join(name).exists() || modules.iter().any(|module| module.file.ends_with(name))
    };
    // What stands between backticks, patterns left out.
    let names = map
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|name| name.ends_with(".rs") && !name.contains('*'));
    let gone: Vec<_> = names.filter(|name| !exists(name)).collect();
    assert!(gone.is_empty(), "docs/architecture.md names {gone:?}");
}
