//! Names that each source file below `src` takes from another one, read from `use` declarations and written paths.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Path of a module below the crate's root, outermost name first.
type ModulePath = Vec<String>;

/// One source file without its tests.
struct SourceFile {
    /// Path below `src`.
    name: String,
    module: ModulePath,
    imports: Vec<Import>,
    /// Paths of two names or more outside `use` declarations.
    paths: BTreeSet<Vec<String>>,
    /// Names that stand alone or first in a path, outside `use` declarations.
    words: BTreeSet<String>,
    /// Names of the items that the file defines.
    defined: BTreeSet<String>,
}

/// One name of a `use` declaration; `*` for a glob.
struct Import {
    path: Vec<String>,
    name: String,
    public: bool,
}

/// The module or the item of a file that a path leads to.
enum Target {
    Module(usize),
    Item(usize, String),
}

/// Source files with the names that each takes from others.
pub(crate) struct Imports {
    files: Vec<SourceFile>,
    modules: BTreeMap<ModulePath, usize>,
}

/// Name below `src`, with `/`, and text of every Rust file, in the order of their paths.
pub(crate) fn source_files() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut open = vec![root.clone()];
    let mut files = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("the folder can be listed") {
            let path = entry.expect("the entry can be read").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let inside = path.strip_prefix(&root).expect("the file is below the root");
                let name = inside.to_string_lossy().replace('\\', "/");
                files.push((name, fs::read_to_string(&path).expect("the source is UTF-8")));
            }
        }
    }
    files.sort();
    files
}

impl Imports {
    /// Reads all files below `src` but `main.rs` and the files of tests.
    pub(crate) fn read() -> Self {
        let library = source_files().into_iter().filter(|(name, _)| name != "main.rs" && !is_test_file(name));
        Self::of(library.collect())
    }

    /// Reads files given as name below `src` and text.
    pub(crate) fn of(mut texts: Vec<(String, String)>) -> Self {
        texts.sort();
        let files: Vec<SourceFile> = texts.into_iter().map(|(name, text)| SourceFile::parse(name, &text)).collect();
        let modules = files.iter().enumerate().map(|(index, file)| (file.module.clone(), index)).collect();
        Self { files, modules }
    }

    /// Circles of files that import each other: per circle one line `from -> to: names` per import inside it.
    pub(crate) fn circles(&self) -> Vec<Vec<String>> {
        let edges: Vec<BTreeMap<usize, BTreeSet<String>>> =
            (0..self.files.len()).map(|index| self.taken_by(index)).collect();
        let reached: Vec<BTreeSet<usize>> = (0..edges.len()).map(|index| reachable(&edges, index)).collect();
        let mut circles: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        for (from, taken) in edges.iter().enumerate() {
            for (to, names) in taken.iter().filter(|(to, _)| reached[**to].contains(&from)) {
                let (from_name, to_name) = (&self.files[from].name, &self.files[*to].name);
                let first = *reached[from].iter().find(|other| reached[**other].contains(&from)).unwrap_or(&from);
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                circles.entry(first).or_default().push(format!("{from_name} -> {to_name}: {}", names.join(", ")));
            }
        }
        circles.into_values().collect()
    }

    /// Files that a file takes names from, with these names.
    fn taken_by(&self, index: usize) -> BTreeMap<usize, BTreeSet<String>> {
        let file = &self.files[index];
        let mut taken: BTreeMap<usize, BTreeSet<String>> = BTreeMap::new();
        let mut take = |target: Option<Target>| {
            if let Some(Target::Item(other, name)) =
                target.filter(|target| !matches!(target, Target::Item(other, _) if *other == index))
            {
                taken.entry(other).or_default().insert(name);
            }
        };
        for import in &file.imports {
            if import.name == "*" {
                if let Some(Target::Module(module)) = self.resolve(index, &import.path, 0) {
                    file.words.iter().for_each(|word| take(self.lookup(module, word, 0)));
                }
            } else if !import.public || file.words.contains(&import.name) {
                take(self.resolve(index, &import.path, 0));
            }
        }
        file.paths.iter().for_each(|path| take(self.resolve(index, path, 0)));
        taken
    }

    /// Target of a path written in a file; `None` for other crates and for names of the file itself.
    fn resolve(&self, from: usize, path: &[String], depth: usize) -> Option<Target> {
        let (first, rest) = path.split_first()?;
        let module = &self.files[from].module;
        match first.as_str() {
            "crate" | "dcvins" => self.walk(*self.modules.get(&Vec::new())?, rest, depth),
            "self" if rest.first().is_some_and(|next| next == "super") => self.resolve(from, rest, depth),
            "self" => self.walk(from, rest, depth),
            "super" => {
                let supers = path.iter().take_while(|part| *part == "super").count();
                let parent = self.modules.get(&module[..module.len().checked_sub(supers)?])?;
                self.walk(*parent, &path[supers..], depth)
            }
            _ => match self.lookup(from, first, depth)? {
                Target::Module(next) => self.walk(next, rest, depth),
                item @ Target::Item(..) => Some(item),
            },
        }
    }

    /// Target of the names `rest`, starting at a module.
    fn walk(&self, module: usize, rest: &[String], depth: usize) -> Option<Target> {
        let Some((first, rest)) = rest.split_first() else { return Some(Target::Module(module)) };
        match self.lookup(module, first, depth) {
            Some(Target::Module(next)) => self.walk(next, rest, depth),
            Some(item) => Some(item),
            None => Some(Target::Item(module, first.clone())),
        }
    }

    /// Target of a name in the scope of a module: own item, child, import or glob import.
    fn lookup(&self, module: usize, name: &str, depth: usize) -> Option<Target> {
        let file = &self.files[module];
        if depth > 20 {
            return None;
        }
        let child = [file.module.as_slice(), &[name.to_owned()]].concat();
        if let Some(child) = self.modules.get(&child) {
            return Some(Target::Module(*child));
        }
        if file.defined.contains(name) {
            return Some(Target::Item(module, name.to_owned()));
        }
        if let Some(import) = file.imports.iter().find(|import| import.name == name) {
            return self.resolve(module, &import.path, depth + 1);
        }
        file.imports.iter().filter(|import| import.name == "*").find_map(|import| {
            match self.resolve(module, &import.path, depth + 1)? {
                Target::Module(other) if other != module => self.lookup(other, name, depth + 1),
                _ => None,
            }
        })
    }
}

/// Files that can be reached from one by one import or more.
fn reachable(edges: &[BTreeMap<usize, BTreeSet<String>>], from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(index) = open.pop() {
        open.extend(edges[index].keys().filter(|next| reached.insert(**next)));
    }
    reached
}

/// Whether a file below `src` holds tests only, by its name or that of its folder.
pub(crate) fn is_test_file(name: &str) -> bool {
    name.split('/').any(|part| part.starts_with("tests") || part.ends_with("_tests.rs"))
}

impl SourceFile {
    fn parse(name: String, text: &str) -> Self {
        let tokens = without_inline_modules(&without_tests(&tokens(text)));
        let (mut imports, mut code) = (Vec::new(), Vec::new());
        let mut at = 0;
        while at < tokens.len() {
            if tokens[at] == "use" && tokens.get(at + 1).is_some_and(|next| next != "<") {
                let end = at + tokens[at..].iter().position(|token| token == ";").unwrap_or(tokens.len() - at - 1);
                let public = at > 0 && (tokens[at - 1] == "pub" || tokens[at - 1] == ")");
                entries(&tokens[at + 1..end], &[], public, &mut imports);
                at = end + 1;
            } else {
                code.push(tokens[at].clone());
                at += 1;
            }
        }
        let (mut paths, mut words, mut defined) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        let is_name = |token: &String| token.starts_with(|letter: char| letter.is_alphabetic() || letter == '_');
        for at in 0..code.len() {
            let before = if at > 0 { code[at - 1].as_str() } else { "" };
            if !is_name(&code[at]) || matches!(before, "::" | ".") {
                continue;
            }
            if matches!(before, "fn" | "struct" | "enum" | "trait" | "const" | "static" | "type" | "union") {
                defined.insert(code[at].clone());
                continue;
            }
            let mut path = vec![code[at].clone()];
            let mut next = at + 1;
            while next + 1 < code.len() && code[next] == "::" && is_name(&code[next + 1]) {
                path.push(code[next + 1].clone());
                next += 2;
            }
            words.insert(path[0].clone());
            if path.len() > 1 {
                paths.insert(path);
            }
        }
        let module = name.trim_end_matches(".rs").split('/').map(str::to_owned);
        let module = module.filter(|part| part != "mod" && part != "lib").collect();
        Self { name, module, imports, paths, words, defined }
    }
}

/// Adds the names of a `use` tree, read below the path `prefix`.
fn entries(tree: &[String], prefix: &[String], public: bool, imports: &mut Vec<Import>) {
    let mut path = prefix.to_vec();
    let mut at = 0;
    while at < tree.len() {
        match tree[at].as_str() {
            "{" => {
                let (mut depth, mut start) = (0_usize, at + 1);
                for (index, token) in tree.iter().enumerate().skip(at) {
                    match token.as_str() {
                        "{" => depth += 1,
                        "}" => depth -= 1,
                        _ => {}
                    }
                    if (depth == 1 && token == ",") || depth == 0 {
                        entries(&tree[start..index], &path, public, imports);
                        start = index + 1;
                    }
                    if depth == 0 {
                        break;
                    }
                }
                return;
            }
            "*" => return imports.push(Import { path, name: "*".to_owned(), public }),
            "::" => {}
            "as" => return imports.push(Import { path, name: tree[at + 1].clone(), public }),
            // `use module::{self, …}` names the module.
            "self" if at > 0 || !prefix.is_empty() => {}
            name => path.push(name.to_owned()),
        }
        at += 1;
    }
    if let Some(name) = path.last().cloned().filter(|_| !tree.is_empty()) {
        imports.push(Import { path, name, public });
    }
}

/// Names, `::` and single punctuation characters of a source text, without comments, literals and lifetimes.
fn tokens(text: &str) -> Vec<String> {
    let letters: Vec<char> = text.chars().collect();
    let is_part = |at: usize| letters.get(at).is_some_and(|letter: &char| letter.is_alphanumeric() || *letter == '_');
    let starts = |at: usize, wanted: &str| wanted.chars().enumerate().all(|(i, c)| letters.get(at + i) == Some(&c));
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < letters.len() {
        let letter = letters[at];
        if starts(at, "//") {
            while at < letters.len() && letters[at] != '\n' {
                at += 1;
            }
        } else if letter == '"' {
            at = end_of_text(&letters, at);
        } else if letter == '\'' {
            // A lifetime has no closing quotation mark behind its first letter.
            if letters.get(at + 1) == Some(&'\\') {
                at += 3;
                while letters.get(at).is_some_and(|letter| *letter != '\'') {
                    at += 1;
                }
                at += 1;
            } else if letters.get(at + 2) == Some(&'\'') {
                at += 3;
            } else {
                at += 1;
                while is_part(at) {
                    at += 1;
                }
            }
        } else if is_part(at) {
            let start = at;
            while is_part(at) {
                at += 1;
            }
            let word: String = letters[start..at].iter().collect();
            let hashes = letters[at..].iter().take_while(|letter| **letter == '#').count();
            if matches!(word.as_str(), "r" | "br") && letters.get(at + hashes) == Some(&'"') {
                at = end_of_raw_text(&letters, at + hashes, hashes);
            } else {
                tokens.push(word);
            }
        } else if starts(at, "::") {
            tokens.push("::".to_owned());
            at += 2;
        } else {
            if !letter.is_whitespace() {
                tokens.push(letter.to_string());
            }
            at += 1;
        }
    }
    tokens
}

/// Position behind a text whose opening quotation mark stands at `at`.
fn end_of_text(letters: &[char], at: usize) -> usize {
    let mut at = at + 1;
    while at < letters.len() && letters[at] != '"' {
        at += if letters[at] == '\\' { 2 } else { 1 };
    }
    at + 1
}

/// Position behind a raw text whose opening quotation mark stands at `at`, behind so many `#`.
fn end_of_raw_text(letters: &[char], at: usize, hashes: usize) -> usize {
    let closes = |at: usize| letters[at] == '"' && (1..=hashes).all(|i| letters.get(at + i) == Some(&'#'));
    (at + 1..letters.len()).find(|at| closes(*at)).map_or(letters.len(), |at| at + 1 + hashes)
}

/// Leaves out items behind `#[cfg(test)]` or `#[cfg(all(test, …))]`.
fn without_tests(tokens: &[String]) -> Vec<String> {
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        let is = |offset: usize, wanted: &str| tokens.get(at + offset).is_some_and(|token| token == wanted);
        let end = at + tokens[at..].iter().position(|token| token == "]").unwrap_or(0);
        let attribute = &tokens[at..end];
        if is(0, "#") && is(1, "[") && is(2, "cfg") && attribute.iter().any(|token| token == "test") {
            at = end_of_item(tokens, end + 1);
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// Names the items of inline modules as if they stood in the file: `super` becomes `self`.
fn without_inline_modules(tokens: &[String]) -> Vec<String> {
    let (mut kept, mut depth, mut inside) = (Vec::new(), 0_usize, Vec::new());
    for (at, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" => {
                if at >= 2 && tokens[at - 2] == "mod" {
                    inside.push(depth);
                }
                depth += 1;
            }
            "}" => {
                depth = depth.saturating_sub(1);
                if inside.last() == Some(&depth) {
                    inside.pop();
                }
            }
            _ => {}
        }
        let leaves = token == "super" && !inside.is_empty() && tokens[at - 1] != "::";
        kept.push(if leaves { "self".to_owned() } else { token.clone() });
    }
    kept
}

/// Position behind the item that starts at `at`: behind its `;`, or behind the brace that closes it.
fn end_of_item(tokens: &[String], mut at: usize) -> usize {
    let mut depth = 0_usize;
    while at < tokens.len() {
        match tokens[at].as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth = depth.saturating_sub(1),
            _ => {}
        }
        at += 1;
        if depth == 0 && matches!(tokens[at - 1].as_str(), ";" | "}") {
            return at;
        }
    }
    at
}
