//! What each module of a crate imports, read from its tokens.
//!
//! Modules are followed from a crate's root through `mod name;`, so test modules and what no one declares are not seen.
//! Comments are no tokens and doc comments are literals, so a link in them is no import.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, Group, Ident, TokenStream, TokenTree};

/// The modules of some crates; roots come before their modules.
#[derive(Default)]
pub(crate) struct Source {
    pub(crate) modules: Vec<Module>,
    /// Modules by the name under which other crates know their root.
    crates: HashMap<String, usize>,
}

/// A module: a file, or a block in one.
pub(crate) struct Module {
    pub(crate) file: PathBuf,
    parent: Option<usize>,
    children: HashMap<String, usize>,
    /// What its `use` declarations call by which name.
    names: HashMap<String, Vec<String>>,
    paths: Vec<ImportPath>,
    /// All words of its code outside paths, by which a re-export that it uses itself is told from one that it only passes on.
    words: Vec<String>,
}

struct ImportPath {
    segments: Vec<String>,
    line: usize,
    /// The name that a `pub use` gives it.
    exported_as: Option<String>,
}

/// Code of module `from` names something that `to` owns.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Import {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) line: usize,
    /// The path as written.
    pub(crate) path: String,
}

impl Source {
    /// Adds the crate that others call `name`. `read` gives the text of a file, if there is one.
    pub(crate) fn add(&mut self, name: &str, root: &Path, read: &dyn Fn(&Path) -> Option<String>) {
        let root_module = self.add_file(root, None, read);
        self.crates.insert(name.to_owned(), root_module);
    }

    fn add_file(
        &mut self,
        file: &Path,
        parent: Option<usize>,
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> usize {
        let text = read(file).unwrap_or_else(|| panic!("no file {}", file.display()));
        let tokens = text.parse().unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        // `a/mod.rs` and roots have their modules next to them, `a.rs` in the folder `a`.
        let is_owner = parent.is_none() || file.ends_with("mod.rs");
        let folder = if is_owner { file.with_file_name("") } else { file.with_extension("") };
        self.add_module(tokens, file, &folder, parent, read)
    }

    fn add_module(
        &mut self,
        tokens: TokenStream,
        file: &Path,
        folder: &Path,
        parent: Option<usize>,
        read: &dyn Fn(&Path) -> Option<String>,
    ) -> usize {
        let index = self.modules.len();
        let mut reader = Reader::default();
        reader.read(tokens);
        self.modules.push(Module {
            file: file.to_owned(),
            parent,
            children: HashMap::new(),
            names: reader.names,
            paths: reader.paths,
            words: reader.words,
        });
        for (name, body) in reader.modules {
            let folder = folder.join(&name);
            let child = match body {
                Some(body) => self.add_module(body, file, &folder, Some(index), read),
                None => {
                    let sibling = folder.with_extension("rs");
                    let file =
                        if read(&sibling).is_some() { sibling } else { folder.join("mod.rs") };
                    self.add_file(&file, Some(index), read)
                }
            };
            self.modules[index].children.insert(name, child);
        }
        index
    }

    /// Every import between modules, re-exports followed to the module that owns the thing.
    ///
    /// A re-export is an import only where the module's own code uses what it passes on.
    pub(crate) fn imports(&self) -> Vec<Import> {
        let mut imports = Vec::new();
        for (from, module) in self.modules.iter().enumerate() {
            for path in &module.paths {
                let only_passed_on =
                    path.exported_as.as_ref().is_some_and(|name| !module.words.contains(name));
                let Some(to) = self.owner(from, &path.segments, 0) else { continue };
                if to != from && !only_passed_on {
                    imports.push(Import {
                        from,
                        to,
                        line: path.line,
                        path: path.segments.join("::"),
                    });
                }
            }
        }
        imports.sort();
        imports.dedup();
        imports
    }

    /// The module that owns what `path` means in module `from`; `None` for things of other crates and local names.
    fn owner(&self, from: usize, path: &[String], depth: usize) -> Option<usize> {
        assert!(depth < 32, "re-exports in a circle: {path:?}");
        let mut at = from;
        for (position, segment) in path.iter().enumerate() {
            let module = &self.modules[at];
            at = if segment == "self" {
                at
            } else if segment == "crate" {
                self.root(at)
            } else if segment == "super" {
                module.parent?
            } else if let Some(&child) = module.children.get(segment) {
                child
            } else if let Some(target) = module.names.get(segment).filter(|target| *target != path)
            {
                let rest = &path[position + 1..];
                let target: Vec<_> = target.iter().chain(rest).cloned().collect();
                return self.owner(at, &target, depth + 1);
            } else if position == 0 {
                *self.crates.get(segment)?
            } else {
                return Some(at); // An item, or a member of one.
            }
        }
        Some(at)
    }

    fn root(&self, module: usize) -> usize {
        std::iter::successors(Some(module), |&at| self.modules[at].parent).last().unwrap_or(module)
    }
}

/// Reads the tokens of a module.
#[derive(Default)]
struct Reader {
    modules: Vec<(String, Option<TokenStream>)>,
    names: HashMap<String, Vec<String>>,
    paths: Vec<ImportPath>,
    words: Vec<String>,
}

impl Reader {
    fn read(&mut self, tokens: TokenStream) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            let rest = &tokens[at..];
            at += match rest {
                [hash, TokenTree::Group(attribute), ..] if is_punct(hash, '#') => {
                    if is_cfg_test(attribute) { item_length(rest) } else { 2 }
                }
                // What `pub(in path)` names is no import.
                [TokenTree::Ident(word), TokenTree::Group(_), ..] if word == "pub" => 2,
                [TokenTree::Ident(word), next, ..] if word == "use" && !is_punct(next, '<') => {
                    let length = rest.iter().take_while(|token| !is_punct(token, ';')).count();
                    self.read_use(&rest[1..length], &[], is_public(&tokens[..at]));
                    length
                }
                [TokenTree::Ident(word), TokenTree::Ident(name), next, ..] if word == "mod" => {
                    let body = match next {
                        TokenTree::Group(body) => Some(body.stream()),
                        _ => None,
                    };
                    self.modules.push((name.to_string(), body));
                    3
                }
                [TokenTree::Ident(first), ..] => self.read_path(first, rest),
                [TokenTree::Group(group), ..] => {
                    self.read(group.stream());
                    1
                }
                // The rest of `<T as Trait>::NAME` is no path.
                [a, b, TokenTree::Ident(_), ..] if is_punct(a, ':') && is_punct(b, ':') => 3,
                _ => 1,
            }
        }
    }

    /// A tree of `use`, with the path before it.
    fn read_use(&mut self, tree: &[TokenTree], before: &[String], is_public: bool) {
        let mut path = before.to_vec();
        let mut line = 0;
        for (position, token) in tree.iter().enumerate() {
            match token {
                TokenTree::Ident(word) if word == "as" => {
                    let name = tree.get(position + 1).map(ToString::to_string);
                    return self.add_use(path, line, name.as_deref(), is_public);
                }
                TokenTree::Ident(word) => {
                    line = word.span().start().line;
                    path.push(word.to_string());
                }
                TokenTree::Group(trees) => {
                    let trees: Vec<_> = trees.stream().into_iter().collect();
                    return trees
                        .split(|token| is_punct(token, ','))
                        .filter(|tree| !tree.is_empty())
                        .for_each(|tree| self.read_use(tree, &path, is_public));
                }
                TokenTree::Punct(punct) if punct.as_char() == '*' => {
                    line = punct.span().start().line;
                    return self.add_use(path, line, None, false);
                }
                _ => {}
            }
        }
        // `a::{self}` is `a`, and `self::a` stays.
        if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = path.last().cloned();
        self.add_use(path, line, name.as_deref(), is_public);
    }

    fn add_use(&mut self, path: Vec<String>, line: usize, name: Option<&str>, is_public: bool) {
        if let Some(name) = name.filter(|name| *name != "_") {
            self.names.insert(name.to_owned(), path.clone());
        }
        let exported_as = name.filter(|_| is_public).map(ToOwned::to_owned);
        self.paths.push(ImportPath { segments: path, line, exported_as });
    }

    /// A path or a word in code; gives its number of tokens.
    fn read_path(&mut self, first: &Ident, tokens: &[TokenTree]) -> usize {
        let mut segments = vec![first.to_string()];
        let mut length = 1;
        while let [a, b, TokenTree::Ident(next), ..] = &tokens[length..]
            && is_punct(a, ':')
            && is_punct(b, ':')
        {
            segments.push(next.to_string());
            length += 3;
        }
        self.words.push(segments[0].clone());
        if segments.len() > 1 {
            let line = first.span().start().line;
            self.paths.push(ImportPath { segments, line, exported_as: None });
        }
        length
    }
}

fn is_punct(token: &TokenTree, character: char) -> bool {
    matches!(token, TokenTree::Punct(punct) if punct.as_char() == character)
}

/// Whether what follows these tokens is `pub` in some degree.
fn is_public(before: &[TokenTree]) -> bool {
    let before = match before {
        [before @ .., TokenTree::Group(_)] => before,
        before => before,
    };
    before.last().is_some_and(|token| token.to_string() == "pub")
}

/// Whether an attribute is `cfg(test)`, or a `cfg` that asks for `test` among others.
fn is_cfg_test(attribute: &Group) -> bool {
    let mut tokens = attribute.stream().into_iter();
    let is_cfg = tokens.next().is_some_and(|token| token.to_string() == "cfg");
    let condition = tokens.next().map(|token| token.to_string()).unwrap_or_default();
    let asks = |word: &str| condition.split(|c: char| !c.is_alphanumeric()).any(|w| w == word);
    is_cfg && asks("test") && !asks("not") && !asks("any")
}

/// Tokens of an item with its attributes: up to a `;`, or to its block.
fn item_length(tokens: &[TokenTree]) -> usize {
    let is_end = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        token => is_punct(token, ';'),
    };
    tokens.iter().position(is_end).map_or(tokens.len(), |end| end + 1)
}
