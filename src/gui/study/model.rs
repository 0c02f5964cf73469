//! State common to all panels of a study: filter, order, groups, metric, and the resulting rows.

use crate::study::view::{Arranged, Metric, RowFilter, SortKey, Study, arrange, columns, group_columns, metrics};

/// Filter, groups and metric of a study view, as on the command line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StudyOptions {
    /// Condition on the rows; empty for all.
    pub filter: String,
    /// Column of groups; `None` for the first one that varies.
    pub group: Option<String>,
    /// Column of the metric; `None` for the trajectory error.
    pub metric: Option<String>,
    /// Name of the reference group of differences; `None` for the first group.
    pub reference: Option<String>,
    /// Condition of a success; `None` for a run with a result.
    pub success: Option<String>,
}

/// A condition as typed, and the last valid one.
#[derive(Clone, Debug, Default)]
pub(crate) struct TypedCondition {
    pub(crate) text: String,
    pub(crate) filter: RowFilter,
    /// Error in the text.
    pub(crate) problem: Option<String>,
}

impl TypedCondition {
    fn new(text: &str, study: &Study) -> Result<Self, String> {
        let filter = RowFilter::parse(text, &study.runs).map_err(|problem| problem.to_string())?;
        Ok(Self { text: text.to_owned(), filter, problem: None })
    }

    /// Parses the text again; an invalid text leaves the last valid condition in effect. Returns true if the condition
    /// in effect changed.
    pub(crate) fn parse(&mut self, study: &Study) -> bool {
        match RowFilter::parse(&self.text, &study.runs) {
            Ok(filter) => {
                self.problem = None;
                let changed = self.filter != filter;
                self.filter = filter;
                changed
            }
            Err(problem) => {
                self.problem = Some(format!("Column {}: {}", problem.column, problem.message));
                false
            }
        }
    }
}

/// State common to all panels.
#[derive(Clone, Debug)]
pub(crate) struct StudyModel {
    pub(crate) filter: TypedCondition,
    pub(crate) success: TypedCondition,
    pub(crate) sort: Vec<SortKey>,
    group: Option<String>,
    reference: Option<String>,
    metric: usize,
    /// Columns with numeric values.
    pub(crate) metrics: Vec<Metric>,
    /// Columns by which rows can be grouped.
    pub(crate) group_columns: Vec<String>,
    /// Rows in the shown order.
    pub(crate) arranged: Arranged,
    /// Increases with every change of rows or groups.
    pub(crate) generation: u64,
    stale: bool,
}

/// Default condition of a success.
const SUCCESS: &str = "status = ok";

impl StudyModel {
    pub(crate) fn new(study: &Study, options: &StudyOptions) -> Result<Self, String> {
        let (metrics, group_columns) = (metrics(&study.runs), group_columns(&study.runs));
        let group = match &options.group {
            Some(group) if group.is_empty() || group == "none" => None,
            Some(group) if study.runs.place(group).is_some() => Some(group.clone()),
            Some(group) => return Err(unknown("group", group, group_columns.iter().map(String::as_str))),
            None => group_columns.first().cloned(),
        };
        let place = |name: &str| metrics.iter().position(|metric| metric.column == name);
        let metric = match &options.metric {
            Some(name) => place(name)
                .ok_or_else(|| unknown("metric", name, metrics.iter().map(|metric| metric.column.as_str())))?,
            None => [columns::ATE, "ate_percent", "chain_error_m", "reprojection_rms_px"]
                .into_iter()
                .find_map(place)
                .unwrap_or(0),
        };
        let default_success = if study.runs.place(columns::STATUS).is_some() { SUCCESS } else { "" };
        let success = TypedCondition::new(options.success.as_deref().unwrap_or(default_success), study)?;
        let mut model = Self {
            filter: TypedCondition::new(&options.filter, study)?,
            success,
            sort: Vec::new(),
            group,
            reference: options.reference.clone(),
            metric,
            metrics,
            group_columns,
            arranged: Arranged::default(),
            generation: 0,
            stale: true,
        };
        model.update(study);
        if let Some(reference) = &options.reference
            && model.arranged.groups.iter().all(|group| group.name != *reference)
        {
            let names = model.arranged.groups.iter().map(|group| group.name.as_str());
            return Err(unknown("reference group", reference, names));
        }
        Ok(model)
    }

    /// Arranges the rows again if anything changed.
    pub(crate) fn update(&mut self, study: &Study) {
        if std::mem::take(&mut self.stale) {
            self.arranged = arrange(&study.runs, &self.filter.filter, &self.sort, self.group.as_deref());
            self.generation += 1;
        }
    }

    pub(crate) fn options(&self) -> StudyOptions {
        StudyOptions {
            filter: self.filter.text.clone(),
            group: self.group.clone(),
            metric: self.metric().map(|metric| metric.column.clone()),
            reference: self.reference().filter(|_| self.group.is_some()).map(str::to_owned),
            success: Some(self.success.text.clone()),
        }
    }

    /// Marks the rows as outdated.
    pub(crate) fn touch(&mut self) {
        self.stale = true;
    }

    pub(crate) fn group(&self) -> Option<&str> {
        self.group.as_deref()
    }

    pub(crate) fn set_group(&mut self, group: Option<String>) {
        if self.group != group {
            (self.group, self.reference) = (group, None);
            self.touch();
        }
    }

    /// Metric of all plots; `None` in a study without numbers.
    pub(crate) fn metric(&self) -> Option<&Metric> {
        self.metrics.get(self.metric)
    }

    pub(crate) fn set_metric(&mut self, place: usize) {
        if self.metric != place {
            self.metric = place;
            self.generation += 1;
        }
    }

    /// Reference group of differences: the chosen one, or the first.
    pub(crate) fn reference(&self) -> Option<&str> {
        let chosen = self.reference.as_ref().filter(|name| self.arranged.groups.iter().any(|of| of.name == **name));
        chosen.map(String::as_str).or_else(|| self.arranged.groups.first().map(|group| group.name.as_str()))
    }

    pub(crate) fn set_reference(&mut self, reference: String) {
        if self.reference.as_ref() != Some(&reference) {
            self.reference = Some(reference);
            self.generation += 1;
        }
    }

    /// Applies a click on the heading of a column: ascending, descending, unsorted. With `add` the other keys stay.
    pub(crate) fn sort_by(&mut self, column: &str, add: bool) {
        let at = self.sort.iter().position(|key| key.column == column);
        let next = match at.map(|at| self.sort[at].descending) {
            None => Some(false),
            Some(false) => Some(true),
            Some(true) => None,
        };
        let key = next.map(|descending| SortKey { column: column.to_owned(), descending });
        match (add, at, key) {
            (true, Some(at), Some(key)) => self.sort[at] = key,
            (true, Some(at), None) => drop(self.sort.remove(at)),
            (true, None, key) => self.sort.extend(key),
            (false, _, key) => self.sort = key.into_iter().collect(),
        }
        self.touch();
    }

    pub(crate) fn success_changed(&mut self) {
        self.generation += 1;
    }
}

fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.take(60).map(|name| if name.is_empty() { "''" } else { name }).collect();
    format!("unknown {what} '{name}': expected one of {}", known.join(", "))
}

pub(crate) fn shown_group(name: &str, column: Option<&str>) -> String {
    match (name.is_empty(), column) {
        (true, None) => "all runs".to_owned(),
        (true, Some(column)) => format!("(no {column})"),
        (false, _) => name.to_owned(),
    }
}
