//! Parsing of the exclusions and Markdown tables of a plan.

use std::collections::BTreeMap;

use super::document::{PlanError, SEEDS, Section};
use super::study_plan::{Exclusion, StudyPlan};
use super::summary_table::{ReferenceValue, Statistic, SummaryColumn, SummaryTable, is_run_column};

const FACTORS: std::ops::RangeInclusive<f64> = -1e12..=1e12;
/// Maximum number of digits after the decimal point.
const MOST_DIGITS: u64 = 12;
/// Default number of digits after the decimal point.
const DIGITS: usize = 3;

pub(super) fn exclusions(root: &Section<'_>) -> Result<Vec<Exclusion>, PlanError> {
    root.sections("exclude")?.iter().map(exclusion).collect()
}

fn exclusion(section: &Section<'_>) -> Result<Exclusion, PlanError> {
    section.allow(&["logs", "disturbances", "perturbations", "specs", "seeds"])?;
    let names = |key: &str| section.texts(key, |text| Ok(text.to_owned()));
    let exclusion = Exclusion {
        logs: names("logs")?,
        disturbances: names("disturbances")?,
        perturbations: names("perturbations")?,
        specs: names("specs")?,
        seeds: section.integers("seeds", SEEDS)?,
    };
    if exclusion == Exclusion::default() {
        return Err(
            section.error("excludes nothing: expected lists of logs, disturbances, perturbations, specs or seeds")
        );
    }
    Ok(exclusion)
}

/// Checks that the exclusions name known levels; an error otherwise. Names of recorded logs are unknown until their files
/// are found.
pub(super) fn check_exclusions(root: &Section<'_>, plan: &StudyPlan) -> Result<(), PlanError> {
    let sections = root.sections("exclude")?;
    for (section, exclusion) in sections.iter().zip(&plan.exclusions) {
        let flights = plan.flights.iter().map(|flight| flight.name.as_str()).collect::<Vec<_>>();
        let disturbances = plan.disturbances.iter().map(|level| level.name.as_str()).collect::<Vec<_>>();
        let perturbations = plan.perturbations.iter().map(|level| level.name.as_str()).collect::<Vec<_>>();
        let specs = plan.labels().collect::<Vec<_>>();
        let mut named = vec![
            ("disturbances", &exclusion.disturbances, disturbances),
            ("perturbations", &exclusion.perturbations, perturbations),
            ("specs", &exclusion.specs, specs),
        ];
        if plan.logs.is_empty() {
            named.push(("logs", &exclusion.logs, flights));
        }
        for (key, names, known) in named {
            if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
                let problem = format!("names '{name}', expected some of {}", known.join(", "));
                return Err(section.error_at(key, &problem));
            }
        }
    }
    Ok(())
}

pub(super) fn tables(root: &Section<'_>) -> Result<Vec<SummaryTable>, PlanError> {
    root.sections("tables")?.iter().map(table).collect()
}

fn table(section: &Section<'_>) -> Result<SummaryTable, PlanError> {
    section.allow(&["title", "rows", "only", "against", "columns", "references"])?;
    let rows = section.texts("rows", run_column)?;
    if rows.is_empty() {
        return Err(section.error("lacks the key 'rows': expected columns by which runs are grouped, as in [\"log\"]"));
    }
    let only = section.section("only")?.map_or_else(|| Ok(BTreeMap::new()), |section| only(&section))?;
    let against = section.section("against")?.map_or_else(|| Ok(BTreeMap::new()), |section| against(&section))?;
    let columns: Vec<SummaryColumn> = section.sections("columns")?.iter().map(column).collect::<Result<_, _>>()?;
    if against.is_empty() && columns.iter().any(|column| column.statistic == Statistic::Ratio) {
        return Err(section.error("has a ratio and no 'against', as in against = { label = \"auto\" }"));
    }
    let reference = |section: &Section<'_>| reference(section, rows.len());
    Ok(SummaryTable {
        title: section.required_text("title")?,
        only,
        against,
        columns,
        references: section.sections("references")?.iter().map(reference).collect::<Result<_, _>>()?,
        rows,
    })
}

/// Checks that a name is a column of the table of runs.
fn run_column(name: &str) -> Result<String, String> {
    if is_run_column(name, false) {
        Ok(name.to_owned())
    } else {
        Err("expected a column of the table of runs".to_owned())
    }
}

fn only(section: &Section<'_>) -> Result<BTreeMap<String, Vec<String>>, PlanError> {
    let values = |key: &str| -> Result<_, PlanError> {
        run_column(key).map_err(|problem| section.error_at(key, &problem))?;
        Ok((key.to_owned(), section.texts(key, |text| Ok(text.to_owned()))?))
    };
    section.keys().map(values).collect()
}

fn against(section: &Section<'_>) -> Result<BTreeMap<String, String>, PlanError> {
    section.allow(&["log", "disturbance", "perturbation", "label"])?;
    section.keys().map(|key| Ok((key.to_owned(), section.required_text(key)?))).collect()
}

fn column(section: &Section<'_>) -> Result<SummaryColumn, PlanError> {
    section.allow(&["column", "title", "statistic", "factor", "digits"])?;
    let column = section.required_text("column")?;
    if !is_run_column(&column, true) {
        let problem = format!("is '{column}', expected a column of numbers of the table of runs");
        return Err(section.error_at("column", &problem));
    }
    Ok(SummaryColumn {
        title: section.text("title")?.unwrap_or_else(|| column.clone()),
        column,
        statistic: section.named("statistic")?.unwrap_or_default(),
        factor: section.number("factor", FACTORS)?.unwrap_or(1.0),
        digits: section.integer("digits", 0..=MOST_DIGITS)?.map_or(DIGITS, |digits| digits as usize),
    })
}

fn reference(section: &Section<'_>, columns: usize) -> Result<ReferenceValue, PlanError> {
    section.allow(&["title", "row", "value"])?;
    let row = section.texts("row", |text| Ok(text.to_owned()))?;
    if row.len() != columns {
        return Err(section.error_at("row", &format!("has {} names, expected one for each of 'rows'", row.len())));
    }
    Ok(ReferenceValue { title: section.required_text("title")?, row, value: section.required_text("value")? })
}
