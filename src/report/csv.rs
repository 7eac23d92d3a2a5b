//! Scores as a long table: one row per case and metric.

use super::results::Results;

/// Scores as CSV with the columns `case,level,metric,value,unit,better`.
///
/// Long rather than wide, so that a new metric adds rows and never shifts a column; every digit is kept.
#[must_use]
pub fn scores_csv(results: &Results) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let mut write = |row: [&str; 6]| {
        // Writing to memory cannot fail, and every row has six fields.
        let _ = writer.write_record(row);
    };
    write(["case", "level", "metric", "value", "unit", "better"]);
    for case in &results.cases {
        for metric in &results.metrics {
            let Some(value) = case.score(&metric.key) else { continue };
            let (level, better) = (metric.level.to_string(), metric.better.word());
            write([&case.id, &level, &metric.key, &value.to_string(), &metric.unit, better]);
        }
    }
    writer.into_inner().map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::super::case::samples::case;
    use super::super::results::samples::results;
    use super::*;

    #[test]
    fn one_row_a_value() {
        let cases = vec![case("a,\"b\"", &[("l0/skate", 0.1), ("l3/upright", 2.0)])];
        assert_eq!(
            scores_csv(&results(cases)),
            "case,level,metric,value,unit,better\n\
             \"a,\"\"b\"\"\",L0,l0/skate,0.1,mm/s,lower\n\
             \"a,\"\"b\"\"\",L3,l3/upright,2,s,higher\n"
        );
    }
}
