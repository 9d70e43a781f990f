//! Every public item has an example: types, traits, functions and constants their own, members of a type at least
//! one in their file.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Files of the modules that `lib.rs` makes public, of those that they make public, and so on.
fn public_files() -> Vec<PathBuf> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let public = |file: &Path| -> Vec<String> {
        let text = fs::read_to_string(file).expect("text");
        let names = text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned));
        names.collect()
    };
    let (mut files, mut open) = (vec![], vec![(src.clone(), src.join("lib.rs"))]);
    while let Some((folder, file)) = open.pop() {
        for name in public(&file) {
            let room = folder.join(&name);
            let file = if room.is_dir() { room.join("mod.rs") } else { folder.join(format!("{name}.rs")) };
            files.push(file.clone());
            open.push((room, file));
        }
    }
    files
}

/// Words of the examples in a file's comments; a block of another language is no example.
fn words_of_examples(text: &str) -> BTreeSet<&str> {
    let (mut inside, mut is_example) = (false, false);
    let mut words = BTreeSet::new();
    for line in text.lines().map(str::trim_start).filter(|line| line.starts_with("//")) {
        let line = line.trim_start_matches(['/', '!']).trim_start();
        if line.starts_with("```") {
            inside = !inside;
            is_example = inside && line == "```";
        } else if is_example {
            words.extend(line.split(|c: char| !c.is_alphanumeric() && c != '_'));
        }
    }
    words
}

/// The name of the item that a line declares, if others can use it.
fn declared(line: &str, in_trait: bool) -> Option<&str> {
    let rest = match line.trim_start().strip_prefix("pub ") {
        Some(rest) => rest,
        None => line.strip_prefix("    ").filter(|rest| in_trait && rest.starts_with("fn "))?,
    };
    let rest = rest.strip_prefix("const fn ").map_or(rest, |name| name);
    let kinds = ["fn ", "struct ", "enum ", "trait ", "type ", "const "];
    let name = kinds.iter().find_map(|kind| rest.strip_prefix(kind)).unwrap_or(rest);
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_')?;
    // A field (`name: type`) and a module end in other signs.
    let is_item = name.len() < rest.len() || line.contains("const fn ");
    is_item.then_some(&name[..end])
}

#[test]
fn every_public_item_has_an_example() {
    let (mut count, mut missing) = (0, vec![]);
    for file in public_files() {
        let text = fs::read_to_string(&file).expect("text");
        let text = text.split("#[cfg(test)]").next().expect("a first part");
        let words = words_of_examples(text);
        let (mut own, mut inside, mut in_trait) = (false, false, false);
        for line in text.lines() {
            if let Some(comment) = line.trim_start().strip_prefix("///") {
                if let Some(language) = comment.trim().strip_prefix("```") {
                    inside = !inside;
                    // An equation is no example.
                    own |= inside && language.is_empty();
                }
                continue;
            }
            if line.trim_start().starts_with("#[") {
                continue;
            }
            in_trait = line.starts_with("pub trait ") || in_trait && !line.starts_with('}');
            if let Some(name) = declared(line, in_trait) {
                count += 1;
                let is_used = line.starts_with(' ') && words.contains(name);
                if !own && !is_used {
                    missing.push(format!("{}: {name}", file.display()));
                }
            }
            own = false;
        }
    }
    assert!(count > 100, "{count} items: are they found?");
    assert_eq!(missing, [""; 0]);
}
